// field.js -- one option as a field: a slider, a box to tick, a choice, or a text. What is set shows the value that the object has.

import {Chart} from './chart.js';
import {make, setText, shown} from './dom.js';

// option: a row of the table.   send(text): sets it; a promise of {reply} or {failure}.
// Returns element, and set(value): the object has this value now.
export function field(option, send) {
    const id = 'option' + option.name, mark = make('span', {class: 'mark', 'aria-hidden': 'true'});
    const now = make('output', {for: id}), number = option.type === 'int' || option.type === 'double';
    const [low, high] = [option.range[0], option.range[option.range.length - 1]];
    const slides = number && option.range.length > 1 && Number.isFinite(low) && Number.isFinite(high);
    const chart = number ? new Chart([option.name]) : null;
    let input, live = null, typing = false;
    if (option.type === 'flag') input = make('input', {id, type: 'checkbox'});
    else if (option.type === 'enum') input = make('select', {id}, ...option.range.map((word) => make('option', {value: String(word)}, String(word))));
    else input = make('input', {id, type: 'text', inputmode: number ? 'decimal' : null, autocomplete: 'off', spellcheck: 'false'});
    const slider = slides ? make('input', {type: 'range', min: low, max: high, step: option.type === 'int' ? 1 : 'any', 'aria-label': `${option.name} slider`}) : null;
    if (option.fixed) for (const one of [input, slider]) if (one) one.disabled = true;
    const text = () => (option.type === 'flag' ? (input.checked ? '1' : '0') : input.value);

    function put(value) {
        if (option.type === 'flag') input.checked = value === 1 || value === '1';
        else input.value = Array.isArray(value) ? value.join(' ') : String(value);
        if (slider) slider.value = value;
        now.textContent = slides ? option.unit : '';
    }
    let busy = false, next = null;
    // While a slider moves, only the newest value waits.
    async function apply(value) {
        next = value;
        if (busy) return;
        busy = true;
        setText(mark, '…');
        let failure;
        while (next !== null) {
            const given = next;
            next = null;
            ({failure} = await send(given));
        }
        busy = typing = false;
        setText(mark, failure ? '✕' : '');
        element.classList.toggle('wrong', Boolean(failure));
        if (live !== null) put(live);
    }
    input.addEventListener('input', () => { typing = true; });
    input.addEventListener('change', () => apply(text()));
    input.addEventListener('keydown', (event) => {
        if (event.key === 'Escape' && live !== null) {
            typing = false;
            put(live);
        }
    });
    if (slider) {
        slider.addEventListener('input', () => {
            typing = true;
            input.value = slider.value;
            apply(slider.value);
        });
    }
    const limits = [option.limits, option.unit].filter(Boolean).join(' ');
    const element = make('div', {class: 'field'}, make('label', {for: id}, option.name.slice(1), ' ', mark), make('div', {class: 'inputs'}, slider, input, now),
        make('p', {class: 'quiet'}, [option.help, limits].filter(Boolean).join(' – ')), chart && make('details', {ontoggle: (event) => chart.show(event.target.open)}, make('summary', {}, 'Chart'), chart.svg, chart.text));
    return {element, set(value) {
        const other = live !== null && !busy && JSON.stringify(live) !== JSON.stringify(value);
        live = value;
        chart?.add(value);
        if (typing || busy) return setText(now, `is ${shown(value)}`);
        put(value);
        if (other) {
            element.classList.add('changed');
            setTimeout(() => element.classList.remove('changed'), 1500);
        }
    }};
}
