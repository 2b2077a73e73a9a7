// chart.js -- the last minute of a number, as a line. It has the newest value at the right, and its limits beside it.

import {setText, shown} from './dom.js';

const space = 'http://www.w3.org/2000/svg', seconds = 60, width = 300, height = 80;

export class Chart {
    constructor(name) {
        this.points = [];               // [ms, value]
        this.svg = document.createElementNS(space, 'svg');
        this.svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
        this.svg.setAttribute('preserveAspectRatio', 'none');
        this.svg.setAttribute('class', 'chart');
        this.svg.setAttribute('role', 'img');
        this.line = document.createElementNS(space, 'polyline');
        this.svg.append(this.line);
        this.text = document.createElement('p');
        this.text.className = 'quiet';
        this.name = name;
        this.timer = 0;
    }
    add(value) {
        if (typeof value !== 'number' || !Number.isFinite(value)) return;
        this.points.push([Date.now(), value]);
        if (this.points.length > 1200) this.points.splice(0, 200);
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
        const end = Date.now(), begin = end - 1000 * seconds;
        // A value holds until the next one; the last one from before the minute begins it.
        while (this.points.length > 1 && this.points[1][0] < begin) this.points.shift();
        if (!this.points.length) return;
        const values = this.points.map((point) => point[1]);
        const low = Math.min(...values), high = Math.max(...values), range = high - low || 1;
        const x = (time) => (width * (Math.max(time, begin) - begin) / (end - begin)).toFixed(1);
        const y = (value) => (height - 4 - (height - 8) * (high === low ? 0.5 : (value - low) / range)).toFixed(1);
        const steps = [];
        this.points.forEach(([time, value], n) => {
            if (n) steps.push(`${x(time)},${y(this.points[n - 1][1])}`);
            steps.push(`${x(time)},${y(value)}`);
        });
        steps.push(`${width},${y(values[values.length - 1])}`);
        this.line.setAttribute('points', steps.join(' '));
        const text = `${shown(low)} to ${shown(high)} in the last minute`;
        this.svg.setAttribute('aria-label', `${this.name}: ${text}`);
        setText(this.text, text);
    }
}
