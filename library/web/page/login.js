// login.js -- a name and a password, or a certificate, for a cookie.

import {setText} from './dom.js';
import {post} from './bus.js';

const [form, name, password, certificate, said] = ['login', 'name', 'password', 'certificate', 'said'].map((id) => document.getElementById(id));

async function logIn(body) {
    try {
        await post('/login', body);
        location.assign('/');
    } catch (failure) {
        setText(said, failure.message);
        password.value = '';
    }
}
form.addEventListener('submit', (event) => {
    event.preventDefault();
    logIn({name: name.value, password: password.value});
});
certificate.addEventListener('click', () => logIn({certificate: true}));

const ways = await fetch('/login').then((response) => response.json());
form.hidden = !ways.passwords;
certificate.hidden = !ways.certificate;
setText(certificate, `Log in as ${ways.certificate}, by certificate`);
if (ways.why) setText(said, ways.why);
else if (!ways.passwords && !ways.certificate) setText(said, 'This browser has shown no certificate. Take one into it, or open the link that sorma-web prints.');
