// overview.js -- all daemons, and the objects of each.

import {make, objectLink, setText} from './dom.js';

const marks = {alive: '✓', busy: '…', silent: '?', refused: '✕', denied: '⊘', dead: '✕', unresolved: '✕', asking: '…', gone: '∅'};

export function overview() {
    const element = make('div', {class: 'cards'});
    const empty = make('p', {class: 'quiet'}, 'No daemon is known. Start one: sormad -name robot');
    element.append(empty);
    const cards = new Map();

    function card(name) {
        if (!cards.has(name)) {
            const parts = {state: make('span', {class: 'mark'}), why: make('p', {class: 'quiet'}), rows: make('tbody')};
            const head = make('tr', {}, ...['Object', 'Class', 'Calls', '1/s'].map((text) => make('th', {scope: 'col'}, text)));
            parts.table = make('table', {}, make('thead', {}, head), parts.rows);
            parts.table.hidden = true;
            parts.element = make('section', {class: 'card', 'aria-label': name}, make('h2', {}, name, ' ', parts.state), parts.why, parts.table);
            cards.set(name, parts);
            const after = [...cards.keys()].sort();
            element.insertBefore(parts.element, cards.get(after[after.indexOf(name) + 1])?.element ?? null);
        }
        return cards.get(name);
    }

    function changed(items, keys) {
        for (const key of keys) {
            const [kind, name] = [key.slice(0, key.indexOf(' ')), key.slice(key.indexOf(' ') + 1)];
            const facts = items.get(key);
            if (!facts) {
                if (kind === 'daemon' && cards.has(name)) {
                    cards.get(name).element.remove();
                    cards.delete(name);
                }
                continue;
            }
            const parts = card(name);
            if (kind === 'daemon') {
                setText(parts.state, `${marks[facts.state] ?? '?'} ${facts.state}`);
                parts.state.className = 'mark ' + facts.state;
                parts.reason = facts.why || '';
            } else {
                parts.error = facts.error || '';
                rows(parts.rows, name, facts.objects || []);
                parts.table.hidden = !facts.objects?.length;
            }
            setText(parts.why, parts.reason || parts.error || '');
        }
        empty.hidden = cards.size > 0;
    }
    return {title: 'Overview', path: '/live/overview', element, changed};
}

// The rows stay where they are, so that a finger hits what it aims at.
function rows(body, daemon, objects) {
    const known = new Map([...body.children].map((row) => [row.dataset.name, row]));
    for (const object of objects) {
        let row = known.get(object.name);
        known.delete(object.name);
        if (!row) {
            const link = make('a', {href: objectLink(`${object.name}@${daemon}`)}, object.name);
            row = make('tr', {'data-name': object.name}, make('th', {scope: 'row'}, link), make('td'), make('td', {class: 'number'}), make('td', {class: 'number'}));
            body.append(row);
        }
        setText(row.children[1], object.class);
        setText(row.children[2], object.calls);
        setText(row.children[3], object.rate);
    }
    for (const row of known.values()) row.remove();
}
