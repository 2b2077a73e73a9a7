// dashboard.js -- a dashboard: its parts on a grid that fills the window, or below each other on a phone.

import {Chart, colour} from './chart.js';
import {builder, make, setText} from './dom.js';
import {request} from './bus.js';
import {follow} from './picture.js';

const marks = {warn: '▲', alarm: '▲', bad: '✕', stale: '?', refused: '⊘', gone: '∅', asking: '…'};
// What is shown is not that of now.
const old = (state) => ['stale', 'refused', 'gone', 'asking'].includes(state);

export function dashboard(name) {
    const element = make('div', {class: 'board'}), wrong = make('p', {class: 'error', role: 'status'});
    const page = crypto.randomUUID();
    const news = builder(build);
    let parts = [];
    wrong.hidden = true;
    element.append(wrong);

    function giveUp() {
        for (const part of parts) part.giveUp?.();
    }
    function build(about) {
        giveUp();
        setText(wrong, about.error);
        wrong.hidden = !about.error;
        element.style.gridTemplateColumns = `repeat(${about.columns}, minmax(0, 1fr))`;
        element.style.setProperty('--rows', about.rows);
        element.style.gridTemplateRows = `repeat(${about.rows}, minmax(28px, 1fr))`;
        parts = about.parts.map((facts) => part(facts, page));
        // Keys, and the eyes of a phone, go row by row.
        const order = about.parts.map((facts, n) => [facts.at[1], facts.at[0], n]).sort((a, b) => a[0] - b[0] || a[1] - b[1]);
        element.replaceChildren(wrong, ...order.map(([, , n]) => parts[n].element));
    }
    function changed(items, keys) {
        for (const key of news(items, keys)) if (key !== 'about' && items.has(key)) parts[key]?.set?.(items.get(key));
    }
    return {title: name, path: '/live/dashboard?name=' + encodeURIComponent(name) + '&page=' + page, element, changed, close: giveUp, full: true};
}

const makers = {display: value, reading: value, status: lamp, led: lamp, meter, button, image, stripchart};

// Its card: a title, what it shows, and below why that is old or missing.
function part(facts, page) {
    const title = make('h2', {}, facts.title), below = make('p', {class: 'why', role: 'status'});
    const element = make('div', {class: `card part ${facts.kind}`, role: 'group', 'aria-label': facts.title}, title);
    const [column, row, width, height] = facts.at;
    element.style.gridArea = `${row + 1} / ${column + 1} / span ${height} / span ${width}`;
    if (facts.error) {
        element.append(make('p', {class: 'error'}, `⊘ ${facts.error}`));
        return {element};
    }
    if (facts.kind === 'text') return {element};
    const made = makers[facts.kind](facts, page, below);
    if (facts.kind === 'button') title.remove();
    element.append(...made.elements, below);
    return {element, giveUp: made.giveUp, set(shown) {
        element.dataset.state = shown.state;
        element.classList.toggle('old', old(shown.state));
        if (!made.says?.()) setText(below, shown.state === 'live' ? '' : shown.why);
        made.set?.(shown);
    }};
}

// As large as there is room for.
function value() {
    const text = make('output', {class: 'digits'});
    const unit = make('span', {class: 'unit'}), mark = make('span', {class: 'unit mark'});
    const line = make('div', {class: 'line'}, mark, text, unit), room = make('div', {class: 'room'}, line);
    return {elements: [room], set(shown) {
        setText(mark, marks[shown.state] ?? '');
        setText(text, shown.text);
        setText(unit, shown.unit ?? '');
        // A text of several lines is a table or a picture of letters.
        const rows = shown.text.split('\n');
        const longest = rows.reduce((most, row) => Math.max(most, row.length), 0);
        room.classList.toggle('rows', rows.length > 1);
        room.style.setProperty('--lines', rows.length);
        line.style.setProperty('--letters', Math.max(4, longest + ((shown.unit ?? '').length + (mark.textContent ? 2 : 0)) / 2));
    }};
}

function lamp(facts) {
    const dot = make('span', {class: 'dot', 'aria-hidden': 'true'}), text = make('output');
    return {elements: [make('div', {class: 'line'}, dot, text)], set(shown) {
        setText(dot, marks[shown.state] ?? '');
        setText(text, facts.kind === 'led' ? {good: 'on', off: 'off', warn: 'warning', bad: 'alarm'}[shown.state] ?? shown.state : shown.text);
    }};
}

function meter(facts) {
    const bar = make('meter', {min: 0, max: 1, 'aria-label': facts.title}), mark = make('span', {class: 'mark'}), text = make('output');
    const level = make('span', {class: 'level'}), track = make('div', {class: 'track', 'aria-hidden': 'true'}, level);
    bar.className = 'unseen';
    return {elements: [make('div', {class: 'line'}, track, bar, mark, text)], set(shown) {
        bar.value = shown.part;
        level.style.width = `${100 * shown.part}%`;
        setText(mark, marks[shown.state] ?? '');
        setText(text, `${shown.text} ${shown.unit}`);
    }};
}

// While its request is under way, a second press of the button, or Escape, gives it up.
function button(facts, page, below) {
    const mark = make('span', {class: 'mark', 'aria-hidden': 'true'});
    const run = make('button', {type: 'button'}, make('span', {}, facts.title), ' ', mark);
    let control = null, said = false, clock = 0;
    const tell = (sign, text) => {
        setText(mark, sign);
        setText(below, text);
        said = text !== '';
    };
    async function press() {
        if (control) return control.abort();
        control = new AbortController();
        const began = performance.now();
        tell('…', '');
        clock = setInterval(() => setText(mark, `… ${((performance.now() - began) / 1000).toFixed(0)} s`), 1000);
        try {
            const moves = facts.method === 'ctrl' ? page : undefined;
            const reply = await request(facts.name, facts.method, {words: facts.words}, {signal: control.signal, seconds: 600, page: moves});
            tell('✓', reply.text ?? '');
        } catch (failure) {
            tell('✕', failure.name === 'AbortError' ? 'cancelled' : failure.message);
        }
        clearInterval(clock);
        control = null;
    }
    run.addEventListener('click', press);
    run.addEventListener('keydown', (event) => { if (event.key === 'Escape') control?.abort(); });
    return {elements: [run], giveUp: () => control?.abort(), says: () => said, set(shown) {
        run.classList.toggle('refused', shown.state === 'refused');
        run.title = shown.why;
        if (!control && !said) setText(mark, marks[shown.state] ?? '');
    }};
}

function image(facts, page, below) {
    const canvas = make('canvas', {role: 'img', 'aria-label': `picture of ${facts.name}`});
    canvas.hidden = true;
    const giveUp = follow(facts.name, facts.words, canvas, Math.max(100, facts.every), () => facts.every > 0 && canvas.isConnected,
        (failure) => setText(below, failure ? `No new picture: ${failure.message}` : ''));
    return {elements: [make('div', {class: 'room'}, canvas)], giveUp};
}

function stripchart(facts) {
    const chart = new Chart(facts.traces, {seconds: facts.span ?? 10, low: facts.low, high: facts.high});
    const names = make('p', {class: 'quiet traces'}, ...facts.traces.map((text, n) => {
        const name = make('span', {}, text);
        name.style.setProperty('--trace', colour(n));
        return name;
    }));
    return {elements: [make('div', {class: 'room'}, chart.svg), names, chart.text], giveUp: () => chart.show(false), set(shown) {
        if (!chart.timer) chart.show(true);
        shown.values.forEach((value, n) => chart.add(value, n));
    }};
}
