// app.js -- which page is shown, whether its values are old, and what stands on every page.

import {make, setText} from './dom.js';
import {post, View} from './bus.js';
import {overview} from './overview.js';
import {object} from './object.js';
import {log} from './log.js';
import {graph} from './graph.js';
import {dashboard} from './dashboard.js';

const main = document.getElementById('main');
const state = document.getElementById('state');
const said = document.getElementById('said');
let view = null, shown = null;

const states = {live: '● live', away: '? no connection', out: '✕ logged out: open a new link'};
function connected(how) {
    document.body.classList.toggle('away', how !== 'live');
    setText(state, states[how]);
}

// What a page has under way ends with it.
function leave() {
    if (view) view.close();
    shown?.close?.();
    main.replaceChildren();
}

function markLink() {
    for (const link of document.querySelectorAll('nav a')) {
        if (link.getAttribute('href') === (location.hash || '#/')) link.setAttribute('aria-current', 'page');
        else link.removeAttribute('aria-current');
    }
}

function show() {
    leave();
    const words = location.hash.replace(/^#\/?/, '').split('/');
    const named = {object, dashboard}[words[0]];
    const page = named ? named(decodeURIComponent(words.slice(1).join('/'))) : ({log, graph}[words[0]] ?? overview)();
    shown = page;
    main.classList.toggle('full', Boolean(page.full));
    document.title = page.title + ' – SORMA';
    main.append(make('h1', {}, page.title), page.element);
    markLink();
    performance.clearMarks('opened');
    view = new View(page.path, (items, keys) => {
        page.changed(items, keys);
        if (!performance.getEntriesByName('opened').length) performance.mark('opened');         // for tests/support/webFigures.tcl
    }, connected);
}

async function tell(work) {
    try {
        setText(said, await work());
    } catch (failure) {
        setText(said, failure.message);
    }
}

document.getElementById('stop').addEventListener('click', () => tell(async () => {
    const reply = await post('/stop');
    return `Stopped: ${reply.stopped.join(', ') || 'nothing'}` + (reply.failed.length ? `; failed: ${reply.failed.join('; ')}` : '');
}));
document.getElementById('link').addEventListener('click', () => tell(async () => (await post('/link')).link));
document.getElementById('logout').addEventListener('click', () => tell(async () => {
    leave();
    await post('/logout');
    connected('out');
    main.append(make('h1', {}, 'Logged out'), make('p', {}, make('a', {href: '/'}, 'Log in again')));
    return 'You are logged out.';
}));
window.addEventListener('hashchange', () => {
    if (location.hash === '#main') return;
    show();
    main.focus();
});
show();
fetch('/dashboards').then((response) => response.json()).then(({dashboards}) => {
    for (const name of dashboards) document.querySelector('nav').append(' ', make('a', {href: '#/dashboard/' + encodeURIComponent(name)}, name));
    markLink();
}).catch(() => {});         // without a login there are none
