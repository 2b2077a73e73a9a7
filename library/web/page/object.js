// object.js -- one object as a panel: its options live, its actions, EXEC with cancel, its help.

import {builder, make, setText, shown} from './dom.js';
import {request} from './bus.js';
import {field} from './field.js';
import {picture} from './picture.js';

export function object(name) {
    const state = make('p', {role: 'status', class: 'mark'}), purpose = make('p', {class: 'quiet'});
    const options = make('div', {class: 'options'}), actions = make('div', {class: 'actions'}), trail = make('ol', {class: 'trail'});
    const help = make('pre'), fields = new Map(), form = execute(name, tell), seen = picture(name);
    const element = make('div', {class: 'object'}, state, purpose, make('section', {class: 'card', 'aria-label': 'Options'}, make('h2', {}, 'Options'), options),
        make('section', {class: 'card', 'aria-label': 'Requests'}, make('h2', {}, 'Requests'), actions, form, trail), seen.element,
        make('details', {class: 'card'}, make('summary', {}, 'Help'), help));
    const page = crypto.randomUUID();
    const news = builder(build);
    seen.element.hidden = true;

    // What came of a request, the newest first; the ten last of them.
    function tell(text, entries = [], wrong = false) {
        const item = make('li', {class: wrong ? 'error' : ''}, make('p', {}, text));
        for (const entry of entries) item.append(make('p', {class: 'quiet'}, `${entry.severity} ${(entry.code ?? []).join(' ')}: ${entry.text} (${entry.so ?? ''}${entry.daemon ? '@' + entry.daemon : ''})`));
        trail.prepend(item);
        while (trail.children.length > 10) trail.lastChild.remove();
    }
    async function send(method, words) {
        try {
            const reply = await request(name, method, {words}, {page});
            return {reply};
        } catch (failure) {
            tell(failure.message, failure.trail, true);
            return {failure};
        }
    }
    function build(about) {
        setText(purpose, [about.class, about.purpose].filter(Boolean).join(': '));
        setText(help, about.help);
        seen.element.hidden = !about.writes.includes('any');
        fields.clear();
        options.replaceChildren(...about.options.map((option) => {
            const one = field(option, (value) => send('ctrl', [option.name, value]));
            fields.set(option.name, one);
            return one.element;
        }));
        actions.replaceChildren(...about.actions.filter((action) => action.arguments === '').map((action) => make('button',
            {type: 'button', title: action.help, class: action.danger === 'stop' ? 'danger' : '', onclick: async () => {
                const {reply} = await send('ctrl', [action.name]);
                if (reply) tell(`${action.name}: ${reply.text || 'done'}`, reply.trail);
            }}, action.name.slice(1))));
    }
    function changed(items, keys) {
        for (const key of news(items, keys)) {
            if (key === 'state' && items.has(key)) {
                const {state: is, why} = items.get(key);
                setText(state, `${{live: '●', stale: '?', refused: '⊘', gone: '∅'}[is] ?? ''} ${is}${why ? ': ' + why : ''}`);
                element.classList.toggle('stale', is !== 'live');
            } else if (fields.has(key) && items.has(key)) {
                fields.get(key).set(items.get(key));
            }
        }
        if (!items.has('about')) {
            options.replaceChildren();
            actions.replaceChildren();
            fields.clear();
            seen.element.hidden = true;
            seen.giveUp();
        }
    }
    return {title: name, path: '/live/object?name=' + encodeURIComponent(name) + '&page=' + page, element, changed, close: () => { form.giveUp(); seen.giveUp(); }};
}

// EXEC: a text, numbers and words; while it is under way, its time and a button that gives it up.
function execute(name, tell) {
    const text = make('input', {id: 'text', autocomplete: 'off'}), numbers = make('input', {id: 'floats', inputmode: 'decimal', autocomplete: 'off'});
    const words = make('input', {id: 'words', autocomplete: 'off'});
    const run = make('button', {type: 'submit', class: 'main'}, 'Execute'), cancel = make('button', {type: 'button', disabled: true}, 'Cancel');
    const progress = make('progress', {'aria-label': 'under way'}), time = make('output');
    progress.hidden = true;
    let control = null;
    cancel.addEventListener('click', () => control?.abort());
    const row = (label, input) => make('div', {class: 'row'}, make('label', {for: input.id}, label), input);
    const form = make('form', {class: 'execute', onsubmit: async (event) => {
        event.preventDefault();
        if (control) return;
        const list = (input) => input.value.trim().split(/\s+/).filter((word) => word !== '');
        const body = {};
        if (text.value !== '') body.text = text.value;
        if (list(numbers).length) body.floats = list(numbers).map(Number);
        if (list(words).length) body.words = list(words);
        if (body.floats?.some((number) => !Number.isFinite(number))) return tell('Numbers are expected, such as 1 2.5 -3e-2', [], true);
        control = new AbortController();
        run.disabled = true;
        cancel.disabled = progress.hidden = false;
        const began = performance.now();
        const clock = setInterval(() => setText(time, `${((performance.now() - began) / 1000).toFixed(1)} s`), 100);
        try {
            const reply = await request(name, 'exec', body, {signal: control.signal, seconds: 600});
            const parts = ['text', 'floats', 'ints', 'any'].filter((key) => key in reply && String(reply[key]) !== '').map((key) => `${key} ${shown(reply[key])}`);
            tell(`EXEC: ${parts.join('; ') || 'done'}${reply.code ? ` (code ${reply.code})` : ''}`, reply.trail);
        } catch (failure) {
            tell(failure.name === 'AbortError' ? 'EXEC: cancelled' : `EXEC: ${failure.message}`, failure.trail, true);
        } finally {
            clearInterval(clock);
            control = null;
            run.disabled = false;
            cancel.disabled = progress.hidden = true;
        }
    }}, row('Text', text), row('Numbers', numbers), row('Words', words), make('div', {class: 'row'}, run, cancel, progress, time));
    form.giveUp = () => control?.abort();
    return form;
}
