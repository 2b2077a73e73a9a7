// rows.h -- the groups of rows, in the order of the table. Each file lists its cases at the top.
#pragma once

#include "measure.h"

namespace bench {

void byReference(Table& table);         // F TO
void tclCommand(Table& table);          // T
void textDispatch(Table& table);        // S
void protectedCall(Table& table);       // P PT PIPE BIG PIECES
void secureCall(Table& table);          // P_tls BIG_tls HANDSHAKE; where there is OpenSSL
void asynchronous(Table& table);        // FUTURE CTRL_busy TIMER_busy STREAM PUBLISH FUTURES
void snapshot(Table& table);            // M
void recording(Table& table);           // RECORD
void cycle(Table& table);               // CYCLE
void circuit(Table& table);             // CIRCUIT
void laboratory(Table& table);          // PUMA_inverse PSOM TRACK; where there is Eigen
void vision(Table& table);              // BALL BOARD; where there is OpenCV
void model(Table& table);              // MODEL
void windows(Table& table);            // PANEL BROWSER DASHBOARD CHART; where there is Tk
void growth(Table& table);              // each of them beside much else

// bench --client ADDRESS nop|rec: the project as one more peer of a comparison with other systems.
int client(const std::string& address, const std::string& payload);

}  // namespace bench
