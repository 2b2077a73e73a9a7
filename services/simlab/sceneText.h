// sceneText.h -- the built-in scenes, as text for MuJoCo.
//
// World frame: z = 0 is the table top, the robot stands at x = y = 0, z = -0.25. Units m, kg, s, rad. The person is at +x
// and has the yellow tokens; a1 is dark and at the person's left. doc/simlab.man, "THE SCENE", explains the numbers.
#pragma once

#include <string>

namespace simlab {

// fields: 8 or 10 on each side of the board; 0: no board and no tokens, for the tracker.
std::string sceneText(int fields);

}  // namespace simlab
