// The laws that act in this module: ROD_LAWS, which laws.py lists before this is included, or none.
#pragma once
#include "laws.h"

namespace rods {

#if !defined(ROD_LAWS)
#define ROD_LAWS
#endif
#if !defined(ROD_UNEVEN)
#define ROD_UNEVEN false
#endif
#if !defined(ROD_FLAT)
#define ROD_FLAT false
#endif
// Whether nodes may be lighter than the scene's, and whether the finger is wider than thick.
constexpr bool UNEVEN = ROD_UNEVEN, FLAT = ROD_FLAT;
typedef Laws<ROD_LAWS> Acting;

}  // namespace rods
