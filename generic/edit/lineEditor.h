// lineEditor.h -- a line typed by a person at a terminal, with libedit, while Tcl's event loop goes on.
//
// read() waits for the line. Meanwhile timers, file events and subscriptions run; they may do anything but read a line
// in turn (busy()). Output that comes from them does not garble what is typed: the edited line is taken off the screen
// before it and drawn again below it.
//
// Below the line stands a hint, which a callback gives for what has been typed so far, in dim letters, cut to the width
// of the terminal; it is not part of what remains on the screen. Tab completes by another callback.
//
// Keys: as libedit's emacs keys, with Ctrl-R to search the history; ~/.editrc may say otherwise ("scott:bind -v").
// Ctrl-C ends the line with How::interrupt, Ctrl-D on an empty one with How::end; so does a terminal that hangs up.
//
// Threads: belongs to its interpreter's thread. One at a time in a process.
#pragma once

#include <histedit.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "edit/outputWatch.h"
#include "edit/signals.h"
#include "tcl/tclShim.h"

namespace sorma::edit {

class LineEditor {
public:
    enum class How { line, end, interrupt };

    struct Completion {
        std::size_t from = 0;                   // the candidates replace what stands from here to the cursor
        std::vector<std::wstring> words;
        std::wstring hint;                      // shown where there is no candidate
    };
    // Text of the line, and the cursor in it. They must not throw, nor read a line.
    using Complete = std::function<Completion(const std::wstring& line, std::size_t point)>;
    using Hint = std::function<std::wstring(const std::wstring& line, std::size_t point)>;

    // Why no line can be edited on this terminal: "standard input is no terminal"; empty when it can.
    static std::string unusable();
    // Width of the terminal in cells; 0 when there is none.
    static int columns();

    explicit LineEditor(Tcl_Interp* interp);
    ~LineEditor();                              // puts the terminal's settings back
    LineEditor(const LineEditor&) = delete;
    LineEditor& operator=(const LineEditor&) = delete;

    // The signals of the terminal belong to the editor as long as it lives, also between two lines.
    Signals signals;

    // Needs unusable() to be empty, and nobody else reading standard input. prompt: at most a few words, no newline.
    How read(const std::wstring& prompt, Complete complete, Hint hint, std::wstring& line);
    bool busy() const { return reading_; }
    // Ctrl-C has ended what one of the callbacks did: as if it had been typed a moment later.
    void interrupt() { interrupted_ = true; }

    // Enter into the history, last one last. The oldest of more than kRemembered go.
    static constexpr int kRemembered = 2000;
    void remember(const std::wstring& entry);

private:
    static LineEditor* of(EditLine* el);
    static wchar_t* promptOf(EditLine* el);
    static int getChar(EditLine* el, wchar_t* c);
    static unsigned char completeKey(EditLine* el, wint_t);
    static void readable(ClientData data, int);

    bool start();
    bool waitForInput();                        // false: interrupted
    int takeByte(unsigned char& byte);          // as read(2) does
    unsigned char complete();
    void list(const std::vector<std::wstring>& words);

    std::wstring text(std::size_t& point) const;
    // Where the cursor and the end of the line are on the screen, in rows and columns from the prompt's first cell.
    struct Place { int row, column; };
    Place place(std::wstring_view text) const;

    void showHint();
    void hideHint();
    void beforeOutput(const char* bytes, int size);    // somebody is about to write
    void redraw();                              // after that
    void put(std::string_view bytes);
    bool settle();                              // the size of the window, output, being continued; whether it drew

    EditLine* el_ = nullptr;
    HistoryW* history_;
    std::unique_ptr<OutputWatch> out_, err_;
    Complete complete_;
    Hint hint_;
    std::wstring prompt_;
    int width_ = 80;
    bool reading_ = false;
    bool ready_ = false;                        // standard input can be read
    bool interrupted_ = false;
    How how_ = How::line;
    // The hint that stands on the screen, rows below the cursor; 0: none.
    int hintRow_ = 0;
    // The line is off the screen, because of output; did that end with a newline?
    bool away_ = false;
    bool fresh_ = true;
};

}  // namespace sorma::edit
