// login.js -- a name and a password for a cookie.

import {setText} from './dom.js';
import {post} from './bus.js';

const [name, password, said] = ['name', 'password', 'said'].map((id) => document.getElementById(id));
document.getElementById('login').addEventListener('submit', async (event) => {
    event.preventDefault();
    try {
        await post('/login', {name: name.value, password: password.value});
        location.assign('/');
    } catch (failure) {
        setText(said, failure.message);
        password.value = '';
    }
});
