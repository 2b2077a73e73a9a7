// graph.js -- who calls whom: a box for each process with its objects, and lines from their callers. The server says where all stands.

import {make, objectLink, setText} from './dom.js';

const space = 'http://www.w3.org/2000/svg', step = 6;

function draw(tag, facts, ...children) {
    const element = document.createElementNS(space, tag);
    for (const [name, value] of Object.entries(facts)) element.setAttribute(name, value);
    element.append(...children);
    return element;
}
// Letters of this size are 0.6 of it wide.
const cut = (text, steps) => (text.length <= steps / 1.2 ? text : text.slice(0, Math.max(1, Math.floor(steps / 1.2) - 1)) + '…');

export function graph() {
    const said = make('p', {class: 'quiet', role: 'status'}), room = make('div', {class: 'graph', tabindex: 0, role: 'region', 'aria-label': 'Calls'});
    const element = make('div', {class: 'card'}, said, room);
    let lines = new Map(), figures = new Map();

    function box({name, at: [x, y, width, height], daemon, objects}) {
        const group = draw('g', {transform: `translate(${x * step} ${y * step})`});
        group.append(draw('rect', {width: width * step, height: height * step, class: 'box'}), draw('rect', {width: width * step, height: 4 * step, class: daemon ? 'head daemon' : 'head'}),
            draw('text', {x: 8, y: 2.8 * step, class: 'name'}, cut(name, width - 3)));
        objects.forEach(([object, own], n) => {
            const height = (7.8 + 4 * n) * step, number = draw('text', {x: width * step - 8, y: height, class: 'figures'});
            figures.set(object, number);
            group.append(draw('a', {href: objectLink(object)}, draw('text', {x: 8, y: height}, draw('title', {}, object), cut(own, width - 22))), number);
        });
        return group;
    }
    function build({size, boxes, lines: ways}) {
        figures = new Map();
        lines = new Map(ways.map(({id, way}) => [id, draw('polyline', {points: way.map((at) => at * step).join(' '), 'marker-end': 'url(#tip)'})]));
        const tip = draw('marker', {id: 'tip', viewBox: '0 0 8 8', refX: 8, refY: 4, markerWidth: 8, markerHeight: 8, markerUnits: 'userSpaceOnUse', orient: 'auto'}, draw('path', {d: 'M0 0L8 4L0 8Z'}));
        const [width, height] = size.map((at) => at * step + 40);
        const svg = draw('svg', {width, height, viewBox: `-20 -20 ${width} ${height}`, role: 'group', 'aria-label': 'who calls whom'}, draw('defs', {}, tip), ...lines.values(), ...boxes.map(box));
        room.replaceChildren(...(boxes.length ? [svg] : []));
    }
    function changed(items, keys) {
        if (items.has('said')) setText(said, items.get('said'));
        if (keys.includes('places') && items.get('places')) build(items.get('places'));
        const rates = items.get('rates');
        if (!rates) return;
        for (const [id, line] of lines) {
            const width = rates.lines[id] ?? 0;
            line.setAttribute('class', width > 0 ? 'busy' : 'idle');
            line.setAttribute('stroke-width', Math.max(1, width));
        }
        for (const [object, number] of figures) setText(number, rates.objects[object] ?? '');
    }
    return {title: 'Calls', path: '/live/graph', element, changed};
}
