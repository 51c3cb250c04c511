// Constants of a time step.
#pragma once
#include "lanes.h"

namespace rods {

// The same for all candidates and steps; in the order of `Numbers` in scene.py.
struct Numbers {
    float dt, rest, stretch, stretch_damping;  // time step [s], rest length of a segment [m], EA [N], [N s/m]
    float table, table_damping;                // bristles of the table [N/m], [N s/m]
    float finger, finger_damping, onset;       // contact with the finger [N/m], [N s/m], depth of full damping [m]
    float own, own_damping, thickness;         // contact of the rope with itself, and where it begins [m]
    float gravity;                             // [m/s^2]
    float stop, tightest;                      // stiffness [N m/rad] beyond the tightest bend [rad]
    float node_mass;                           // of an inner node of the scene's rope [kg]
    float centring;                            // pull on where a segment meets a flat finger to the segment's middle
};

}  // namespace rods
