// dom.js -- elements of a page. Every text is data: it goes into a page as text alone.

// An element: make('button', {type: 'button', onclick: f}, 'Run', other)
export function make(tag, facts = {}, ...children) {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(facts)) {
        if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
        else if (name === 'value' || name === 'checked' || name === 'disabled') element[name] = value;
        else if (value !== null && value !== undefined) element.setAttribute(name, value);
    }
    element.append(...children.filter((child) => child !== null));
    return element;
}

// Change only what is new: a reader of the screen hears of nothing else.
export function setText(element, text) {
    const now = String(text);
    if (element.textContent !== now) element.textContent = now;
}

// A value as people read it.
export function shown(value) {
    if (Array.isArray(value)) return value.map(shown).join(' ');
    return typeof value === 'number' ? String(Number(value.toPrecision(6))) : String(value);
}

export const objectLink = (name) => '#/object/' + encodeURIComponent(name);

// For a page that the item `about` of its view describes: build(about) makes it, anew when `about` is another one. Returns a function of (items, keys),
// as View calls it, which returns the keys that are to be shown: after a build, all of them.
export function builder(build) {
    let known = '';
    return (items, keys) => {
        if (!keys.includes('about')) return keys;
        const text = items.has('about') ? JSON.stringify(items.get('about')) : '';
        const same = text === known || text === '';
        known = text;
        if (same) return keys;
        build(items.get('about'));
        return [...items.keys()];
    };
}
