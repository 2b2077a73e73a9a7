// picture.js -- the picture that an object hands out: one, or live. The next one is asked for when the last one has been drawn: a slow
// client gets fewer pictures, and always the newest. A page that nobody sees asks for none.

import {make, setText} from './dom.js';
import {image} from './bus.js';

const wait = (ms) => new Promise((done) => setTimeout(done, ms));
const frame = () => new Promise((done) => requestAnimationFrame(done));
const least = 100;                              // ms from one picture to the next

// PGM or PPM as pixels of a canvas. Its head is the word of a stranger: nothing is made before the bytes are there.
function pixelsOf(bytes) {
    const head = /^P([56])\s+(?:#[^\n]*\n\s*)*(\d{1,6})\s+(\d{1,6})\s+(\d{1,5})\s/.exec(String.fromCharCode(...bytes.subarray(0, 1000)));
    if (!head) throw new Error('its head is none of PGM or PPM');
    const [channels, width, height, most] = [head[1] === '6' ? 3 : 1, ...head.slice(2).map(Number)];
    const size = most > 255 ? 2 : 1, from = head[0].length;
    if (!width || !height || !most || bytes.length - from < width * height * channels * size) throw new Error(`${width} x ${height} pixels are said, there are ${bytes.length - from} bytes`);
    const data = new ImageData(width, height), out = data.data, scale = most === 255 ? 1 : 255 / most;
    const value = (n) => (size === 2 ? bytes[from + 2 * n] * 256 + bytes[from + 2 * n + 1] : bytes[from + n]) * scale;
    for (let n = 0; n < width * height; ++n) {
        const k = n * channels;
        out[4 * n] = value(k);
        out[4 * n + 1] = channels === 3 ? value(k + 1) : out[4 * n];
        out[4 * n + 2] = channels === 3 ? value(k + 2) : out[4 * n];
        out[4 * n + 3] = 255;
    }
    return data;
}

// A picture onto a canvas.
async function draw(canvas, blob) {
    if (blob.type.startsWith('image/x-portable')) {
        const data = pixelsOf(new Uint8Array(await blob.arrayBuffer()));
        [canvas.width, canvas.height] = [data.width, data.height];
        canvas.getContext('2d').putImageData(data, 0, 0);
    } else {
        const map = await createImageBitmap(blob).catch(() => { throw new Error(`${blob.type} that cannot be read`); });
        [canvas.width, canvas.height] = [map.width, map.height];
        canvas.getContext('2d').drawImage(map, 0, 0);
        map.close();
    }
    canvas.hidden = false;
}

// Ask and draw, again and again while `again` says so. told(failure) is called after each picture; without a failure it was drawn.
// every: ms from one picture to the next, at least. Returns what ends it.
export function follow(name, words, canvas, every, again, told) {
    const control = new AbortController();
    (async () => {
        do {
            const began = performance.now();
            let pause = 0;
            try {
                await draw(canvas, await image(name, words, control.signal));
                if (control.signal.aborted) return;
                canvas.classList.remove('old');
                told(null);
            } catch (failure) {
                if (control.signal.aborted) return;
                canvas.classList.add('old');
                told(failure);
                pause = 2000;
            }
            await frame();
            if (again()) await wait(Math.max(pause, every - (performance.now() - began)));
        } while (again() && !control.signal.aborted);
    })();
    return () => control.abort();
}

export function picture(name) {
    const words = make('input', {id: 'pictureWords', autocomplete: 'off', spellcheck: 'false'});
    const live = make('input', {id: 'live', type: 'checkbox'}), one = make('button', {type: 'button'}, 'One picture');
    const facts = make('p', {class: 'quiet number'}), wrong = make('p', {class: 'error', role: 'status'});
    const canvas = make('canvas', {role: 'img', 'aria-label': `picture of ${name}`});
    canvas.hidden = true;
    const element = make('details', {class: 'card picture'}, make('summary', {}, 'Picture'),
        make('p', {class: 'quiet'}, 'Each picture is the reply to EXEC with these words.'),
        make('div', {class: 'row'}, make('label', {for: words.id}, 'Words'), words, one, make('label', {for: live.id}, 'Live'), live), canvas, facts, wrong);
    let end = () => {}, last = 0;

    // Until it is not live any more, or something begins anew.
    function run() {
        end();
        const list = words.value.trim().split(/\s+/).filter((word) => word !== '');
        end = follow(name, list, canvas, least, () => live.checked, (failure) => {
            if (failure) {
                setText(wrong, `No new picture: ${failure.message}`);
                if (failure.status >= 400 && failure.status < 500) live.checked = false;       // asking again does not help
                return;
            }
            const now = performance.now(), rate = 1000 / (now - last);
            setText(facts, `${canvas.width} × ${canvas.height}${live.checked && rate < 1000 ? `, ${rate.toPrecision(2)} in a second` : ''}`);
            last = now;
            setText(wrong, '');
        });
    }
    function giveUp() {
        live.checked = false;
        end();
    }
    one.addEventListener('click', () => { live.checked = false; run(); });
    live.addEventListener('change', () => (live.checked ? run() : giveUp()));
    words.addEventListener('keydown', (event) => { if (event.key === 'Enter') run(); });
    element.addEventListener('toggle', () => { if (!element.open) giveUp(); });
    return {element, giveUp};
}
