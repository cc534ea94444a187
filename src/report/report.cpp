#include "files.hpp"
#include "result.hpp"
#include "squeal/base/whole_file.hpp"
#include "squeal/report/results_folder.hpp"

#include <cctype>
#include <dmumps_c.h>
#ifdef SQUEAL_WITH_GMSH
#include <gmsh.h>
#endif

namespace squeal
{

namespace
{

/// The options of this run in the form that -options_file reads.
std::string option_text()
{
  char* list = nullptr;
  check(PetscOptionsGetAll(nullptr, &list));
  std::string text = list;
  check(PetscFree(list));
  for (std::size_t at = 0; (at = text.find(" -", at)) != std::string::npos;)
    if (const char next = at + 2 < text.size() ? text[at + 2] : ' '; std::isalpha(static_cast<unsigned char>(next)))
      text[at] = '\n'; // an option, not a negative number
    else
      ++at;
  return text + "\n";
}

std::string provenance(const std::string& run)
{
  std::string text = "# run " + run + ", by";
  for (const auto& [name, version] : versions()) text += " " + name + " " + version + ",";
  text.back() = '\n';
  return text;
}

} // namespace

const Estimate& followed_estimate(const Report& report)
{
  static const Estimate none;
  if (report.motion.followed.estimate) return *report.motion.followed.estimate;
  return report.point.estimates.empty() ? none : report.point.estimates.front();
}

std::array<std::pair<Stage, Outcome>, 12> outcomes_of(const Report& report)
{
  return {{{Stage::equilibrium, report.point.equilibrium.outcome},
           {Stage::modes, report.point.modes.outcome},
           {Stage::estimate, followed_estimate(report).outcome},
           {Stage::response, report.response.outcome},
           {Stage::transient, report.transient.outcome},
           {Stage::cycle, report.motion.cycle.outcome},
           {Stage::settled, report.motion.settled.outcome},
           {Stage::attractors, report.attractors.outcome},
           {Stage::branch, report.branch.outcome},
           {Stage::sensitivity, report.sensitivity.outcome},
           {Stage::sweep, report.sweep.outcome},
           {Stage::robustness, report.robustness.outcome}}};
}

std::vector<std::pair<std::string, std::string>> versions()
{
  const auto number = [](auto major, auto minor, auto release)
  { return std::to_string(major) + "." + std::to_string(minor) + "." + std::to_string(release); };
  PetscInt major = 0, minor = 0, release = 0;
  unsigned hdf5_major = 0, hdf5_minor = 0, hdf5_release = 0;
  std::vector<std::pair<std::string, std::string>> list = {{"squeal", SQUEAL_VERSION}, {"commit", SQUEAL_COMMIT}};
  check(PetscGetVersionNumber(&major, &minor, &release, nullptr));
  list.emplace_back("petsc", number(major, minor, release));
  check(SlepcGetVersionNumber(&major, &minor, &release, nullptr));
  list.emplace_back("slepc", number(major, minor, release));
  list.emplace_back("mumps", MUMPS_VERSION);
  H5get_libversion(&hdf5_major, &hdf5_minor, &hdf5_release);
  list.emplace_back("hdf5", number(hdf5_major, hdf5_minor, hdf5_release));
#ifdef SQUEAL_WITH_GMSH
  list.emplace_back("gmsh", GMSH_API_VERSION);
#endif
  return list;
}

void write_request(const Scene& scene, const std::string& run, const std::filesystem::path& output, MPI_Comm comm)
{
  on_rank_zero(comm,
               [&]
               {
                 write_whole_file(output / word(ResultFile::resolved_scene), provenance(run) + resolved_scene(scene));
                 write_whole_file(output / word(ResultFile::options), provenance(run) + option_text());
               });
}

void write_results(const Report& report, const Scene& scene, const Model& nodes, const std::filesystem::path& output,
                   MPI_Comm comm)
{
  const auto write = [&](ResultFile file, const std::string& text) { write_whole_file(output / word(file), text); };
  const auto write_list = [&](ResultFile file, const Result& list)
  {
    if (!list.parts.empty()) write(file, csv_of(list));
  };
  on_rank_zero(comm,
               [&]
               {
                 write_history(report, scene, output / word(ResultFile::history));
                 write_list(ResultFile::sweep, sweep_modes(report.sweep, scene, Content::results));
                 write_list(ResultFile::robustness, robustness_samples(report.robustness, scene, Content::results));
               });
  write_fields(report, scene, nodes, output, comm);
  // Last: where there is a report, the rest is there too.
  on_rank_zero(comm, [&] { write(ResultFile::report, report_json(report, scene)); });
}

} // namespace squeal
