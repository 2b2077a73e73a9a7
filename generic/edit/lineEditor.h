// lineEditor.h -- reads a line from a terminal, with libedit, while Tcl's event loop runs.
//
// read() waits for the line. Meanwhile timers, file events and subscriptions run. They may do anything but call read() (see
// busy()). When they write to the terminal, the edited line is erased before their output and drawn again below it.
//
// Below the line there may be a hint in dim letters, which a callback makes from the text so far. It is cut to the width of
// the terminal, and erased when the line is complete. Tab completes, by another callback.
//
// Keys: libedit's emacs keys, and Ctrl-R to search the history; ~/.editrc may change them ("scott:bind -v"). Ctrl-C ends the
// line with How::interrupt; Ctrl-D on an empty line, or a terminal that hangs up, with How::end.
//
// Threads: belongs to its interpreter's thread. There may be one at a time in a process.
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
        std::size_t from = 0;                   // a candidate replaces the text from here to the cursor
        std::vector<std::wstring> words;        // the candidates
        std::wstring hint;                      // shown when there is no candidate
    };
    // line: the text so far.   point: the cursor in it.   They must not throw, and must not call read().
    using Complete = std::function<Completion(const std::wstring& line, std::size_t point)>;
    using Hint = std::function<std::wstring(const std::wstring& line, std::size_t point)>;

    // The reason why lines cannot be edited here: "standard input is no terminal"; empty when they can.
    static std::string unusable();
    // Width of the terminal in cells; 0 when there is none.
    static int columns();

    explicit LineEditor(Tcl_Interp* interp);
    ~LineEditor();                              // restores the terminal's settings
    LineEditor(const LineEditor&) = delete;
    LineEditor& operator=(const LineEditor&) = delete;

    // Handles the signals of the terminal as long as the editor exists, also between two lines.
    Signals signals;

    // Read a line; blocks, and runs the event loop. Requires that unusable() is empty and that nobody else reads standard
    // input.
    // prompt: a few words at most, no newline.   line: becomes the line, without its newline.
    How read(const std::wstring& prompt, Complete complete, Hint hint, std::wstring& line);
    bool busy() const { return reading_; }
    // From an event while the editor waits for a key: what the hint was made from has changed, so it is made again.
    void renewHint();
    // Ctrl-C has interrupted a script that ran in the event loop of read(): read() ends with How::interrupt, too.
    void interrupt() { interrupted_ = true; }

    // Add a line to the history, as the latest. The oldest are removed when there are more than kRemembered.
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
    // Place on the screen of the end of a text, in rows and columns from the prompt's first cell.
    struct Place { int row, column; };
    Place place(std::wstring_view text) const;

    void showHint();
    void hideHint();
    void beforeOutput(const char* bytes, int size);    // these bytes are about to be written to the terminal
    void redraw();                              // after them
    void put(std::string_view bytes);
    bool settle();                              // draw again if the window's size changed, output came, or the program was continued

    EditLine* el_ = nullptr;
    HistoryW* history_;
    std::unique_ptr<OutputWatch> out_, err_;
    Complete complete_;
    Hint hint_;
    std::wstring prompt_;
    int width_ = 80;
    bool reading_ = false;
    bool waits_ = false;                        // for a key, in the event loop
    bool ready_ = false;                        // standard input can be read
    bool interrupted_ = false;
    How how_ = How::line;
    int hintRow_ = 0;                           // rows from the cursor down to the hint; 0: there is none
    bool away_ = false;                         // the line is erased, because of output
    bool fresh_ = true;                         // that output ended with a newline
};

}  // namespace sorma::edit
