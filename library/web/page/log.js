// log.js -- trails of all daemons as they come, the newest first.

import {make, objectLink} from './dom.js';

export function log() {
    const list = make('ol', {class: 'trail', 'aria-label': 'Messages'}), empty = make('p', {class: 'quiet'}, 'Nothing has happened since this page was opened.');
    const element = make('div', {class: 'card'}, empty, list), shown = new Map();
    function changed(items, keys) {
        for (const key of keys.sort((a, b) => a - b)) {
            const entry = items.get(key);
            if (!entry) {
                shown.get(key)?.remove();
                shown.delete(key);
            } else if (!shown.has(key)) {
                const line = make('li', {class: entry.severity}, make('a', {href: objectLink(entry.name)}, entry.name), ` ${entry.severity}: ${entry.text}`);
                shown.set(key, line);
                list.prepend(line);
            }
        }
        empty.hidden = shown.size > 0;
    }
    return {title: 'Log', path: '/live/log', element, changed};
}
