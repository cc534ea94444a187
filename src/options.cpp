#include "squeal/options.hpp"

#include "squeal/base/petsc.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <sstream>

namespace squeal
{

namespace
{

struct Option
{
  const char *name, *standard, *meaning;
};

// The one list of squeal's own options: help and nearest-name messages read it, each stage queries its own.
constexpr std::array options = {
    Option{"-factor", "automatic", "of the step and of equilibrium: supernodal (on rank 0), mumps (on all), dense"},
    Option{"-factor_limit", "0.3", "GB of a supernodal factor; beyond it several ranks share MUMPS's instead"},
    Option{"-equilibrium_max_it", "100", "status iterations before giving up"},
    Option{"-equilibrium_check_max_it", "-1", "of the fixed point run as a check; -1: 20000 up to 600 pairs, else 0"},
    Option{"-equilibrium_check_rho", "1.5", "of that fixed point, over 1/lambda_max, below 2"},
    Option{"-transient_friction", "theta", "opposes the sliding velocity at theta, or at the end of the step (end)"},
    Option{"-transient_contact_law", "displacement", "contact on displacements, or on velocities (velocity)"},
    Option{"-transient_contact_solver", "gauss_seidel", "block Gauss-Seidel, or projection fixed point (fixed_point)"},
    Option{"-transient_contact_tolerance", "1e-10", "largest natural map of a pair over the largest reaction"},
    Option{"-transient_contact_max_it", "1000", "contact iterations (sweeps) allowed a step"},
    Option{"-transient_contact_rho", "0", "of the fixed point, over 1/lambda_max(W); 0: chosen"},
    Option{"-transient_contact_extrapolation", "2", "highest order in time of the warm start; the best one is taken"},
    Option{"-transient_refuse", "true", "false: march even where theta and the step make growth rates lie"},
    Option{"-modes_dense_limit", "400", "eigenproblems up to this size are solved whole by LAPACK"},
    Option{"-modes_solver", "slices", "of large problems: slices of frequency, or TOAR around zero (toar)"},
    Option{"-modes_factor_room", "30", "[%] of memory beyond what MUMPS foresees for a factor; it grows by itself"},
    Option{"-modes_candidates", "20", "pairs that each residual pass of the projection corrects"},
    Option{"-estimate_lift_off_multiple", "2", "of first lift-off: where vibrations start without an energy balance"},
    Option{"-cycle_start", "estimate", "of the full model's shooting: estimate, or reduced (that model's cycle)"},
    Option{"-cycle_start_amplitude", "1", "multiple of the estimate's amplitude to start from"},
    Option{"-cycle_start_phase", "0", "degrees, added to the estimate's phase of the start"},
    Option{"-cycle_start_period", "1", "multiple of the mode's period to start from"},
    Option{"-reduced_margin", "1.5", "pairs that part at this many times the motion's amplitude keep their contact"},
    Option{"-reduced_threshold", "1e-5", "an attachment shape is dropped when less than this part of it is new"},
    Option{"-reduced_modes", "100000", "complex modes taken, the followed one and the nearest in frequency"},
    Option{"-reduced_free_periods", "100", "at most integrated on the reduced model until its motion is periodic"},
    Option{"-reduced_corrections", "40", "periods of the full model at most, from the reduced model's cycle on"},
    Option{"-cycle_subspace_newtons", "10", "iterations on the subspace of the mode's shapes; 0: not tried"},
    Option{"-cycle_base_growths", "-1",
           "times the subspace may grow by what it missed; below 0: 4 without a finish, else 0"},
    Option{"-cycle_rank_tolerance", "1e-7", "relative, of the subspace's base and of its least-squares solve"},
    Option{"-cycle_difference", "1e-6", "difference step over the fluctuation, in the energy norm"},
    Option{"-cycle_finish", "multisecant", "full-space finish: multisecant, newton_krylov or none"},
    Option{"-cycle_band_factor", "3", "real modes of the preconditioner reach this many times the mode's frequency"},
    Option{"-cycle_secants", "60", "secants kept by the finish"},
    Option{"-cycle_secant_drop", "1e-4", "a secant is dropped when less than this part of it is new"},
    Option{"-cycle_clamp", "0.3", "longest step of the finish over the fluctuation"},
    Option{"-cycle_stall", "30", "iterations without progress before the finish starts again, or falls back"},
    Option{"-cycle_max_periods", "400", "periods that may be integrated in all"},
    Option{
        "-cycle_multipliers", "-1",
        "Floquet multipliers' Krylov dimension, 0: none; -1: all up to 25 dofs, else 8 and 2 a further unstable mode"},
    Option{"-cycle_samples", "32", "displacements kept over the last period, for the fields file"},
};

constexpr std::array stages = {"equilibrium_", "modes_",    "transient_", "cycle_",
                               "cycle_full_",  "estimate_", "reduced_"};

// What a stage hands on to a solver object, which checks the rest itself.
constexpr std::array solver_parts = {"snes_", "ksp_", "pc_", "pep_", "eps_", "st_",
                                     "mat_",  "bv_",  "ds_", "rg_",  "vec_"};

// PETSc's and SLEPc's own, about the session rather than a solver.
constexpr std::array session_options = {
    "log_",         "info",     "options_", "malloc",       "memory_",   "mat_",
    "vec_",         "is_",      "blas_",    "sf_",          "fp_trap",   "on_error",
    "no_signal",    "debugger", "start_in", "error_output", "get_total", "version",
    "citations",    "history",  "mpi",      "saws",         "device_",   "checkstack",
    "objects_",     "petsc",    "slepc",    "matmatmult",   "matptap",   "mattransposematmult",
    "vecscatter",   "viewer_",  "test",     "nox",          "display",   "use_gpu",
    "check_pointer"};

bool begins(const std::string& name, const char* prefix)
{
  return name.rfind(prefix, 0) == 0;
}

template <class Prefixes> bool begins_with_one_of(const std::string& name, const Prefixes& prefixes)
{
  return std::any_of(prefixes.begin(), prefixes.end(), [&](const char* prefix) { return begins(name, prefix); });
}

std::string suggestion(const std::string& option)
{
  std::vector<std::string> known;
  for (const Option& candidate : options) known.emplace_back(candidate.name);
  for (const char* stage : stages)
    for (const char* part : solver_parts) known.push_back(std::string("-") + stage + part + "…");
  const std::string nearest = nearest_word(option, known);
  return nearest.empty() ? "squeal -help lists the options" : "did you mean " + nearest + "?";
}

/// Empty if the option may exist. `name` without its dash.
std::string problem_with(const std::string& name)
{
  const std::string option = "-" + name;
  if (std::any_of(options.begin(), options.end(), [&](const Option& known) { return option == known.name; })) return {};
  if (begins_with_one_of(name, session_options)) return {};
  for (const char* stage : stages)
    if (begins(name, stage) && begins_with_one_of(name.substr(std::string(stage).size()), solver_parts)) return {};
  return "unknown option " + option + "; " + suggestion(option);
}

} // namespace

std::string option_reference()
{
  std::ostringstream text;
  for (const Option& option : options)
  {
    text << "  " << option.name;
    for (std::size_t column = std::string(option.name).size(); column < 36; ++column) text << ' ';
    text << option.meaning << " [" << option.standard << "]\n";
  }
  return text.str();
}

void check_option_names(MPI_Comm comm)
{
  char* all = nullptr;
  check(PetscOptionsGetAll(nullptr, &all));
  std::istringstream words(all ? all : "");
  check(PetscFree(all));
  std::string problem;
  for (std::string word; problem.empty() && words >> word;)
    if (word.size() > 1 && word[0] == '-' && std::isalpha(static_cast<unsigned char>(word[1])))
      problem = problem_with(word.substr(1));
  agree(comm, problem);
}

void check_options_used(const std::vector<std::string>& stages_run, MPI_Comm comm)
{
  PetscInt count = 0;
  char **names = nullptr, **values = nullptr;
  check(PetscOptionsLeftGet(nullptr, &count, &names, &values));
  std::string problem;
  for (PetscInt i = 0; i < count; ++i)
  {
    const std::string name = names[i];
    if (begins_with_one_of(name, session_options)) continue;
    const auto stage =
        std::find_if(stages.begin(), stages.end(), [&](const char* prefix) { return begins(name, prefix); });
    const bool ran = stage == stages.end() || std::any_of(stages_run.begin(), stages_run.end(),
                                                          [&](const std::string& run) { return run + "_" == *stage; });
    if (ran)
      problem += (problem.empty() ? "" : "; ") + ("option -" + name + " was never used, ") + suggestion("-" + name);
  }
  check(PetscOptionsLeftRestore(nullptr, &count, &names, &values));
  agree(comm, problem);
}

} // namespace squeal
