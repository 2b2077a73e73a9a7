// site.js -- what the web pages do beyond text: a search without a server, and a button that copies code.
//
// words.js, which doc/html.tcl makes, is loaded when somebody wants to search. It calls sormaSearch.take with a list of
// [page, heading, address, text in lower case].
const sormaSearch = {
    places: null,

    begin() {
        if (this.places === null) {
            this.places = [];
            const script = document.createElement('script');
            script.src = 'words.js';
            document.head.append(script);
        }
    },
    take(places) {
        this.places = places;
        this.show();
    },
    // All words must be there. A place is better when its heading has them.
    found(wanted) {
        return this.places.map(([page, heading, address, text]) => {
            const head = heading.toLowerCase();
            const all = head + ' ' + page.toLowerCase() + ' ' + text;
            if (!wanted.every(word => all.includes(word))) return null;
            const score = wanted.reduce((sum, word) => sum + (head === word ? 8 : head.includes(word) ? 4 : 0) + (page.toLowerCase().includes(word) ? 2 : 0), 0);
            return {page, heading, address, score};
        }).filter(place => place).sort((a, b) => b.score - a.score).slice(0, 20);
    },
    show() {
        const list = document.getElementById('found');
        const wanted = document.getElementById('search').value.toLowerCase().split(/\s+/).filter(word => word);
        list.replaceChildren(...(wanted.length ? this.found(wanted) : []).map(({page, heading, address}) => {
            const link = document.createElement('a');
            link.href = address;
            link.textContent = heading;
            const where = document.createElement('small');
            where.textContent = page;
            const item = document.createElement('li');
            item.append(link, ' ', where);
            return item;
        }));
        list.hidden = list.childElementCount === 0;
    }
};

// What a person types of a piece of code: of a session only the lines behind prompts, with those that go on from them.
function typedOf(text) {
    const lines = text.replace(/\n$/, '').split('\n');
    if (!lines.some(line => /^\w*[%$] /.test(line))) return lines.join('\n');
    const typed = [];
    let open = 0;
    for (const line of lines) {
        const prompt = /^\w*[%$] (.*)$/.exec(line);
        if (prompt === null && open <= 0) continue;
        const part = prompt === null ? line : prompt[1].replace(/\s+;#.*$/, '');
        open = (prompt === null ? open : 0) + part.split('{').length - part.split('}').length;
        typed.push(part);
    }
    return typed.join('\n');
}

document.addEventListener('DOMContentLoaded', () => {
    const field = document.getElementById('search');
    field.addEventListener('focus', () => sormaSearch.begin());
    field.addEventListener('input', () => { sormaSearch.begin(); sormaSearch.show(); });
    field.addEventListener('keydown', event => {
        const first = document.querySelector('#found a');
        if (event.key === 'Enter' && first) location.href = first.href;
        if (event.key === 'Escape') { field.value = ''; sormaSearch.show(); }
    });
    for (const block of document.querySelectorAll('pre')) {
        const button = document.createElement('button');
        button.textContent = 'copy';
        const text = block.textContent;
        button.addEventListener('click', async () => {
            await navigator.clipboard.writeText(typedOf(text));
            button.textContent = 'copied';
            setTimeout(() => { button.textContent = 'copy'; }, 1500);
        });
        const frame = document.createElement('div');
        frame.className = 'code';
        block.replaceWith(frame);
        frame.append(block, button);
    }
});
