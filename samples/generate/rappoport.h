#pragma once

#include <fielddeform/solid/solid_io.h>

/// Objects for the examples of Rappoport, Sheffer & Bercovier 1996.
namespace fielddeform::samples {

/// One solid, an amphora along y of degrees (3, 3, 7), its foot and its lip held.
solid::SolidFile amphora();

/// Three tricubic solids along x, joined C1: earpiece, handle, mouthpiece of a telephone's handset; the mouthpiece's outer side is moved so that
/// the handle is stretched.
/// @param stretch  how far
solid::SolidFile telephone(double stretch = 0.9);

}  // namespace fielddeform::samples
