// tclPieces.h -- the reply of a service class in Tcl as a stream. Its exec runs in a coroutine, and gives pieces with sorma::piece.
// It waits there until the reader wants another one. The result of exec is the last piece, or the last pieces.
#pragma once

#include <memory>
#include <string>

#include "bus/pieces.h"
#include "tcl/tclService.h"

namespace sorma {

class TclPieces : public Pieces {
public:
    TclPieces(TclService& service, Message& request);
    ~TclPieces() override;
    bool next(Message& piece, std::size_t most) override;
    bool works() const override { return !run_->done; }
    std::size_t heap() const override;

    void give(Tcl_Obj* dict);           // sorma::piece; an empty one is ignored
    bool wanted() { return !waits_; }   // may it go on, since the piece has been taken and another one is wanted?
    void came();                        // a piece, or the end

private:
    void goOn();

    TclService& service_;
    Obj message_;                       // the request, until it begins
    std::shared_ptr<TclRun> run_ = std::make_shared<TclRun>();
    std::string coroutine_;             // empty: it has not begun
    Message piece_;
    bool has_ = false;                  // piece_ is one
    bool waits_ = false;                // it waits in sorma::piece
    bool going_ = false;                // goOn() is on the stack
    std::unique_ptr<Pieces> rest_;      // of what exec has returned
};

}  // namespace sorma
