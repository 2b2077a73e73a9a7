// bus.js -- what a page asks of its server: requests, and views that stay live.

export class Failure extends Error {
    constructor(status, error) {
        super(error.message);
        this.status = status;
        this.code = error.code || [];
        this.trail = error.trail || [];
    }
}

async function answerOf(response) {
    let body = null;
    try {
        body = await response.json();
    } catch {
        throw new Failure(response.status, {message: response.status === 401 ? 'You are not logged in, or no longer.' : 'The answer makes no sense.'});
    }
    if (!response.ok) throw new Failure(response.status, body.error || {message: 'It was refused.'});
    return body;
}

// POST with JSON. signal: of an AbortController; when it is aborted, the request is given up.
export async function post(path, body = {}, signal = undefined) {
    const headers = {'Content-Type': 'application/json'};
    return answerOf(await fetch(path, {method: 'POST', headers, body: JSON.stringify(body), signal}));
}

// page: the id with which its view was opened; what a CTRL moves then ends with that view.
export const request = (name, method, body, {signal, seconds = 25, page} = {}) =>
    post(`/api/${encodeURIComponent(name)}/${method}?timeout=${seconds}${page ? '&page=' + page : ''}`, body, signal);

// The picture of the reply to EXEC, as a Blob.
export async function image(name, words, signal) {
    const response = await fetch(`/api/${encodeURIComponent(name)}/image`, {method: 'POST', headers: {'Content-Type': 'application/json'}, body: JSON.stringify({words}), signal});
    return response.ok ? response.blob() : answerOf(response);
}

// A view: items by key, as they change. changed(items, keys) is called after each change, state(how) when the server
// goes (away), comes (live), or knows this browser no longer (out).
// EventSource comes back by itself, unless the server refuses: then it is made anew.
export class View {
    constructor(path, changed, state) {
        this.path = path;
        this.changed = changed;
        this.state = state;
        this.items = new Map();
        this.closed = false;
        this.open();
        this.watch = setInterval(() => this.look(), 1000);
    }
    open() {
        this.heard = Date.now();
        this.fresh = true;
        this.source = new EventSource(this.path);
        this.source.onopen = () => { this.fresh = true; };
        this.source.addEventListener('items', (event) => this.take(JSON.parse(event.data)));
        this.source.addEventListener('tick', () => this.hear());
        this.source.onerror = () => {
            this.state('away');
            if (this.source.readyState === EventSource.CLOSED) this.refused();
        };
    }
    async refused() {
        const status = await fetch('/api').then((response) => response.status, () => 0);
        if (this.closed) return;
        this.lost = status === 401;
        if (this.lost) this.state('out');
        else setTimeout(() => { if (!this.closed) this.open(); }, 3000);
    }
    hear() {
        this.heard = Date.now();
        this.state('live');
    }
    look() {
        if (!this.lost && Date.now() - this.heard > 6000) this.state('away');
    }
    take(news) {
        this.hear();
        if (this.fresh) {                       // after a gap comes everything
            for (const key of this.items.keys()) if (!(key in news)) news[key] = null;
            this.fresh = false;
        }
        for (const [key, value] of Object.entries(news)) {
            if (value === null) this.items.delete(key);
            else this.items.set(key, value);
        }
        this.changed(this.items, Object.keys(news));
    }
    close() {
        this.closed = true;
        clearInterval(this.watch);
        this.source.close();
    }
}
