#include "edit/lineEditor.h"

#include <langinfo.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <clocale>
#include <cstdlib>
#include <cstring>
#include <cwchar>
#include <utility>

#include "edit/text.h"

namespace sorma::edit {

namespace {

constexpr int kNarrowest = 10;          // [cells] below this a line cannot be edited sensibly

std::string_view terminalName() {
    const char* name = std::getenv("TERM");
    return name ? name : "";
}

}  // namespace

std::string LineEditor::unusable() {
    if (!isatty(0)) return "standard input is no terminal";
    if (!isatty(1)) return "standard output is no terminal";
    auto name = terminalName();
    if (name.empty() || name == "dumb" || name == "unknown") return "the terminal \"" + std::string(name) + "\" cannot move its cursor";
    if (int n = columns(); n > 0 && n < kNarrowest) return "the terminal has only " + std::to_string(n) + " columns";
    return {};
}

int LineEditor::columns() {
    winsize size{};
    for (int fd : {1, 0})
        if (ioctl(fd, TIOCGWINSZ, &size) == 0) return size.ws_col;
    return 0;
}

LineEditor::LineEditor(Tcl_Interp* interp) : signals(interp), history_(history_winit()) {
    HistEventW event;
    history_w(history_, &event, H_SETSIZE, kRemembered);
    history_w(history_, &event, H_SETUNIQUE, 1);
    auto before = [this](const char* bytes, int size) { beforeOutput(bytes, size); };
    if (isatty(1)) out_ = std::make_unique<OutputWatch>(interp, TCL_STDOUT, before);
    if (isatty(2)) err_ = std::make_unique<OutputWatch>(interp, TCL_STDERR, before);
}

LineEditor::~LineEditor() {
    if (reading_) {                     // the program ends in a callback
        Tcl_DeleteFileHandler(0);
        hideHint();
        put("\r\n");
    }
    out_.reset();
    err_.reset();
    if (el_) el_end(el_);
    history_wend(history_);
}

// libedit begins with the first line, so that a program that never reads one changes nothing at the terminal.
bool LineEditor::start() {
    if (el_) return true;
    // In the locale C wide characters end at 127, while nearly every terminal of today speaks UTF-8.
    if (std::strcmp(nl_langinfo(CODESET), "ANSI_X3.4-1968") == 0) std::setlocale(LC_CTYPE, "C.UTF-8");
    el_ = el_init("scott", stdin, stdout, stderr);
    if (!el_) return false;
    Signals::keepTerminal();
    el_wset(el_, EL_CLIENTDATA, this);
    el_wset(el_, EL_PROMPT, promptOf);
    el_wset(el_, EL_GETCFN, getChar);
    el_wset(el_, EL_EDITOR, L"emacs");
    el_wset(el_, EL_SIGNAL, 0);
    el_wset(el_, EL_HIST, history_w, history_);
    el_wset(el_, EL_ADDFN, L"sorma-complete", L"complete the word before the cursor", completeKey);
    el_wset(el_, EL_BIND, L"^I", L"sorma-complete", nullptr);
    el_wset(el_, EL_BIND, L"^R", L"em-inc-search-prev", nullptr);
    el_wset(el_, EL_BIND, L"^W", L"ed-delete-prev-word", nullptr);
    el_source(el_, nullptr);
    const wchar_t* mode = nullptr;
    if (el_wget(el_, EL_EDITOR, &mode) == 0 && mode && std::wcscmp(mode, L"vi") == 0)
        el_wset(el_, EL_BIND, L"^I", L"sorma-complete", nullptr);       // that has changed all keys
    return true;
}

LineEditor* LineEditor::of(EditLine* el) {
    void* self = nullptr;
    el_wget(el, EL_CLIENTDATA, &self);
    return static_cast<LineEditor*>(self);
}

wchar_t* LineEditor::promptOf(EditLine* el) { return of(el)->prompt_.data(); }

void LineEditor::remember(const std::wstring& entry) {
    HistEventW event;
    history_w(history_, &event, H_ENTER, entry.c_str());
}

LineEditor::How LineEditor::read(const std::wstring& prompt, Complete complete, Hint hint, std::wstring& line) {
    if (!start()) return How::end;
    Tcl_Flush(Tcl_GetStdChannel(TCL_STDOUT));
    prompt_ = prompt;
    complete_ = std::move(complete);
    hint_ = std::move(hint);
    how_ = How::end;
    away_ = false;
    interrupted_ = false;
    hintRow_ = 0;
    el_resize(el_);
    width_ = std::max(columns(), kNarrowest);
    reading_ = true;
    // libedit would do it when it waits for the first character: what is typed before would be echoed, and be there twice.
    el_wset(el_, EL_PREP_TERM, 1);
    Signals::Waiting waiting(signals);
    int count = 0;
    const wchar_t* got = el_wgets(el_, &count);
    reading_ = false;
    Tcl_DeleteFileHandler(0);
    if (got && count > 0) {
        line.assign(got, std::size_t(count));
        if (line.back() == L'\n') line.pop_back();
        how_ = How::line;
    } else {
        put(how_ == How::interrupt ? "^C\r\n" : "\r\n");
    }
    complete_ = nullptr;
    hint_ = nullptr;
    return how_;
}

// ---- one character ----

// Once: as long as the byte is not taken Tcl would call again, also in an event loop that a callback runs.
void LineEditor::readable(ClientData data, int) {
    static_cast<LineEditor*>(data)->ready_ = true;
    Tcl_DeleteFileHandler(0);
}

bool LineEditor::waitForInput() {
    pollfd input{0, POLLIN, 0};
    if (poll(&input, 1, 0) > 0) return true;    // more of what was pasted
    showHint();
    ready_ = false;
    Tcl_CreateFileHandler(0, TCL_READABLE, readable, this);
    while (true) {
        // Before waiting, too: a signal that came while a hint was computed has had its wake-up already.
        if (settle()) continue;
        if (interrupted_ || signals.interrupted()) {
            Tcl_DeleteFileHandler(0);
            hideHint();
            how_ = How::interrupt;
            return false;
        }
        if (ready_) return true;
        waits_ = true;
        Tcl_DoOneEvent(TCL_ALL_EVENTS);
        waits_ = false;
    }
}

int LineEditor::takeByte(unsigned char& byte) {
    while (true) {
        auto n = ::read(0, &byte, 1);
        if (n >= 0) return int(n);
        if (errno == EAGAIN) {
            pollfd input{0, POLLIN, 0};
            poll(&input, 1, -1);
        } else if (errno != EINTR) {
            return -1;
        }
    }
}

int LineEditor::getChar(EditLine* el, wchar_t* c) {
    LineEditor& e = *of(el);
    if (!e.waitForInput()) return -1;
    unsigned char byte;
    if (e.takeByte(byte) <= 0) {
        e.hideHint();
        return 0;
    }
    std::string bytes(1, char(byte));
    int more = byte >= 0xf0 ? 3 : byte >= 0xe0 ? 2 : byte >= 0xc0 ? 1 : 0;
    for (; more > 0 && e.takeByte(byte) > 0; --more) bytes += char(byte);
    *c = toWide(bytes)[0];
    e.hideHint();
    return 1;
}

bool LineEditor::settle() {
    if (signals.continued()) {
        // The shell may have left the terminal as it likes it.
        el_wset(el_, EL_PREP_TERM, 0);
        el_wset(el_, EL_PREP_TERM, 1);
        hintRow_ = 0;
        away_ = true;
        fresh_ = true;
    }
    if (signals.resized()) {
        if (!away_) beforeOutput("\n", 1);
        el_resize(el_);
        width_ = std::max(columns(), kNarrowest);
    }
    if (!away_) return false;
    redraw();
    return true;
}

// ---- the screen ----

std::wstring LineEditor::text(std::size_t& point) const {
    const LineInfoW* info = el_wline(el_);
    point = std::size_t(info->cursor - info->buffer);
    return {info->buffer, std::size_t(info->lastchar - info->buffer)};
}

LineEditor::Place LineEditor::place(std::wstring_view text) const {
    Place p{0, 0};
    auto step = [&](wchar_t c) {
        if (c == L'\n') {
            p = {p.row + 1, 0};
            return;
        }
        int n = c == L'\t' ? 8 - p.column % 8 : cells(c);
        if (n == 2 && c >= L' ' && p.column == width_ - 1) p = {p.row + 1, 0};      // a wide one is not cut
        p.column += n;
        if (p.column >= width_) p = {p.row + 1, p.column - width_};
    };
    for (wchar_t c : prompt_) step(c);
    for (wchar_t c : text) step(c);
    return p;
}

void LineEditor::put(std::string_view bytes) {
    fwrite(bytes.data(), 1, bytes.size(), stdout);
    fflush(stdout);
}

void LineEditor::showHint() {
    if (!hint_ || away_ || hintRow_ > 0) return;
    std::size_t point;
    std::wstring line = text(point);
    if (line.find(L'\n') != line.npos) return;      // several lines, or the prompt of a search
    std::wstring hint = fitted(hint_(line, point), width_ - 1);
    if (hint.empty() || away_) return;
    Place cursor = place(std::wstring_view(line).substr(0, point));
    hintRow_ = place(line).row - cursor.row + 1;
    std::string bytes(std::size_t(hintRow_), '\n');     // scrolls where it has to
    bytes += "\r\033[K\033[2m" + toUtf8(hint) + "\033[0m\033[" + std::to_string(hintRow_) + "A\r";
    if (cursor.column > 0) bytes += "\033[" + std::to_string(cursor.column) + "C";
    put(bytes);
}

void LineEditor::renewHint() {
    if (!std::exchange(waits_, false)) return;
    hideHint();
    showHint();
    waits_ = true;
}

void LineEditor::hideHint() {
    if (hintRow_ == 0) return;
    std::size_t point;
    std::wstring line = text(point);
    Place cursor = place(std::wstring_view(line).substr(0, point));
    auto rows = std::to_string(hintRow_);
    std::string bytes = "\033[" + rows + "B\r\033[K\033[" + rows + "A";
    if (cursor.column > 0) bytes += "\033[" + std::to_string(cursor.column) + "C";
    put(bytes);
    hintRow_ = 0;
}

void LineEditor::beforeOutput(const char* bytes, int size) {
    if (!reading_ || size == 0) return;
    if (!away_) {
        std::size_t point;
        std::wstring line = text(point);
        int up = place(std::wstring_view(line).substr(0, point)).row;
        put(up > 0 ? "\r\033[" + std::to_string(up) + "A\033[J" : "\r\033[J");
        hintRow_ = 0;
        away_ = true;
    }
    fresh_ = bytes[size - 1] == '\n';
}

void LineEditor::redraw() {
    Tcl_Flush(Tcl_GetStdChannel(TCL_STDOUT));
    if (!fresh_) put("\r\n");
    away_ = false;
    el_wset(el_, EL_REFRESH);
    showHint();
}

// ---- completion ----

unsigned char LineEditor::completeKey(EditLine* el, wint_t) { return of(el)->complete(); }

unsigned char LineEditor::complete() {
    if (!complete_) return CC_ERROR;
    std::size_t point;
    std::wstring line = text(point);
    Completion found = complete_(line, point);
    if (away_) redraw();
    if (found.words.empty() || found.from > point) return CC_REFRESH_BEEP;
    std::wstring common = found.words[0];
    for (auto& w : found.words) {
        auto end = std::mismatch(common.begin(), common.end(), w.begin(), w.end()).first;
        common.erase(end, common.end());
    }
    std::size_t typed = point - found.from;
    bool grows = common.size() >= typed && common != std::wstring_view(line).substr(found.from, typed);
    bool unique = found.words.size() == 1;
    // A word is finished unless it leads somewhere.
    if (unique && (common.empty() || !wcschr(L"/@.:", common.back())) && line.substr(point, 1) != L" ") {
        common += L' ';
        grows = true;
    }
    if (grows) {
        if (typed > 0) el_deletestr(el_, int(typed));
        el_winsertstr(el_, common.c_str());
        return CC_REFRESH;
    }
    if (unique) return CC_REFRESH;
    list(found.words);
    return CC_NORM;
}

void LineEditor::list(const std::vector<std::wstring>& words) {
    constexpr std::size_t kRows = 12;
    int widest = 0;
    for (auto& w : words) widest = std::max(widest, cells(w));
    int cell = std::min(widest, width_ - 1) + 2;
    auto perRow = std::size_t(std::max(1, (width_ + 1) / cell));
    std::size_t rows = (words.size() + perRow - 1) / perRow;
    std::size_t shown = std::min(rows, kRows);
    std::wstring out;
    for (std::size_t r = 0; r < shown; ++r) {
        std::wstring row;
        for (std::size_t c = 0; c < perRow && c * rows + r < words.size(); ++c) {
            if (c > 0) row += std::wstring(std::size_t(std::max(0, int(c) * cell - cells(row))), L' ');
            row += fitted(words[c * rows + r], width_ - 1);
        }
        out += row + L"\r\n";
    }
    if (rows > shown) out += L"... " + std::to_wstring(words.size()) + L" in all\r\n";
    std::size_t point;
    std::wstring line = text(point);
    int down = place(line).row - place(std::wstring_view(line).substr(0, point)).row;
    put((down > 0 ? "\033[" + std::to_string(down) + "B" : "") + "\r\n" + toUtf8(out));
    el_wset(el_, EL_REFRESH);
}

}  // namespace sorma::edit
