// chart.js -- numbers of the last minute, or of so many seconds, as lines. The newest values are at the right; the lowest and the highest stand below.

import {setText, shown} from './dom.js';

const space = 'http://www.w3.org/2000/svg', width = 300, height = 80;
export const colour = (n) => `var(--series${n % 6 + 1})`;

export class Chart {
    // names: of the lines. low, high: of what is shown; without them it is as the numbers need.
    constructor(names, {seconds = 60, low, high} = {}) {
        this.names = names;
        this.seconds = seconds;
        this.fixed = [low, high];
        this.lines = names.map((name, n) => {
            const line = document.createElementNS(space, 'path');
            line.style.stroke = colour(n);
            return {points: [], line};                  // points: [ms, value]; a value that is none begins a gap
        });
        this.svg = document.createElementNS(space, 'svg');
        this.svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
        this.svg.setAttribute('preserveAspectRatio', 'none');
        this.svg.setAttribute('class', 'chart');
        this.svg.setAttribute('role', 'img');
        this.svg.append(...this.lines.map(({line}) => line));
        this.text = document.createElement('p');
        this.text.className = 'quiet';
        this.timer = 0;
    }
    add(value, n = 0) {
        const {points} = this.lines[n];
        points.push([Date.now(), typeof value === 'number' && Number.isFinite(value) ? value : null]);
        if (points.length > 4000) points.splice(0, 400);
    }
    // Drawn only while somebody sees it.
    show(is) {
        clearInterval(this.timer);
        if (is) {
            this.timer = setInterval(() => (this.svg.isConnected ? this.draw() : this.show(false)), 200);
            this.draw();
        }
    }
    draw() {
        const end = Date.now(), begin = end - 1000 * this.seconds;
        // A value holds until the next one; the last one from before that time begins it.
        for (const {points} of this.lines) while (points.length > 1 && points[1][0] < begin) points.shift();
        const values = this.lines.flatMap(({points}) => points.map((point) => point[1])).filter((value) => value !== null);
        if (!values.length) return;
        const least = values.reduce((a, b) => Math.min(a, b)), most = values.reduce((a, b) => Math.max(a, b));
        const low = this.fixed[0] ?? least, high = this.fixed[1] ?? most, range = high - low;
        const x = (time) => (width * (Math.max(time, begin) - begin) / (end - begin)).toFixed(1);
        const y = (value) => (height - 4 - (height - 8) * (range > 0 ? (value - low) / range : 0.5)).toFixed(1);
        for (const {points, line} of this.lines) {
            const steps = [];
            points.forEach(([time, value], n) => {
                if (value === null) return;
                steps.push(n && points[n - 1][1] !== null ? `H${x(time)}V${y(value)}` : `M${x(time)} ${y(value)}`);
                steps.push(`H${n + 1 < points.length ? x(points[n + 1][0]) : width}`);
            });
            line.setAttribute('d', steps.join(''));
        }
        const text = `${shown(least)} to ${shown(most)} in the last ${this.seconds === 60 ? 'minute' : this.seconds + ' s'}`;
        this.svg.setAttribute('aria-label', `${this.names.join(', ')}: ${text}`);
        setText(this.text, text);
    }
}
