#pragma once
/// The names that results have in their folder.
#include "squeal/base/words.hpp"

#include <array>

namespace squeal
{

/// The files of a results folder.
enum class ResultFile
{
  report,
  history,
  sweep,
  sweep_motions,
  robustness,
  fields,
  field_places, // how ParaView finds its way in the fields
  resolved_scene,
  options,
  reduced,     // a folder of matrices
  checkpoints, // a folder
};

template <> inline constexpr std::array words_of<ResultFile> = {
    "report.json", "history.h5",    "sweep.csv",   "sweep_motions.csv", "robustness.csv", "fields.h5",
    "fields.xdmf", "resolved.toml", "options.txt", "reduced",           "checkpoint"};

} // namespace squeal
