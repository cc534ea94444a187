#pragma once
/// The largest Lyapunov exponents of a flow along a motion, from its batched tangent (src/README.md, section 7.10). A
/// few columns are carried along and made orthonormal again in the energy product after every window of time. The
/// logarithms of what they were stretched by are the exponents. Functions that take a flow are collective.
#include "squeal/settled/statistics.hpp"
#include "squeal/shooting/flow.hpp"

#include <vector>

namespace squeal
{

/// Columns that are carried along a motion.
struct TangentBundle
{
  std::vector<Owned<Vec>> columns;         // energy-orthonormal
  std::vector<std::vector<double>> growth; // [column][window] logarithm of its stretching
};

/// `count` columns in no special direction.
TangentBundle make_bundle(const Flow& flow, Vec like, PetscInt count);

/// Carries the columns along the window that the flow recorded last.
void follow_period(const Flow& flow, TangentBundle& bundle);

/// Largest first, per so many windows, from those after the first `skipped`. A column that shears without growing, as
/// on a torus, is stretched in proportion to the time. That is ln 2 over the last half of the windows, which the bars
/// include. Not collective.
std::vector<MeanValue> exponents_of(const TangentBundle& bundle, std::size_t skipped, double windows);

} // namespace squeal
