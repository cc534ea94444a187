#include "squeal/base/run_control.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <sys/prctl.h>
#include <unistd.h>
#include <utility>

namespace squeal
{

namespace
{

using Clock = std::chrono::steady_clock;

constexpr int by_time_limit = 1000; // beside the numbers of signals
/// As under nohup. PETSc replaces it when it starts.
const bool ignores_hangup = []
{
  struct sigaction given = {};
  return sigaction(SIGHUP, nullptr, &given) == 0 && given.sa_handler == SIG_IGN;
}();

/// Read before MPI starts, which sets the same variables when it starts by itself.
const std::string rank_by_launcher = []() -> std::string
{
  for (const char* name : {"OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "SLURM_PROCID"})
    if (const char* rank = std::getenv(name)) return rank;
  return {};
}();

/// Signals of terminals, and those by which schedulers announce a limit.
constexpr std::array<std::pair<int, const char*>, 6> ending_signals = {{{SIGTERM, "SIGTERM"},
                                                                        {SIGINT, "SIGINT"},
                                                                        {SIGHUP, "SIGHUP"},
                                                                        {SIGUSR1, "SIGUSR1"},
                                                                        {SIGUSR2, "SIGUSR2"},
                                                                        {SIGXCPU, "SIGXCPU"}}};

/// The control of this process; a signal handler can be given nothing.
struct Control
{
  RunLimits limits;
  Clock::time_point begun = Clock::now(), last_checkpoint = begun;
  int ended_by = 0; // agreed: a signal's number, or by_time_limit
  bool checkpoint_due = false;
  bool undisturbed = false; // nothing is asked
};

Control& control()
{
  static Control one;
  return one;
}

volatile std::sig_atomic_t signal_received = 0;

void note_signal(int number)
{
  signal_received = number;
}

double seconds_since(Clock::time_point time)
{
  return std::chrono::duration<double>(Clock::now() - time).count();
}

bool time_is_up()
{
  const double limit = control().limits.time_limit;
  return limit > 0 && seconds_since(control().begun) > limit;
}

/// All ranks of `comm` take what any of them knows, and its rank 0's clock.
void agree_on_requests(MPI_Comm comm)
{
  Control& own = control();
  int rank = 0;
  MPI_Comm_rank(comm, &rank);
  std::array<int, 2> known = {std::max(static_cast<int>(signal_received), own.ended_by), 0};
  if (rank == 0)
  {
    if (known[0] == 0 && time_is_up()) known[0] = by_time_limit;
    known[1] = seconds_since(own.last_checkpoint) >= own.limits.checkpoint_interval;
  }
  MPI_Allreduce(MPI_IN_PLACE, known.data(), 2, MPI_INT, MPI_MAX, comm);
  own.ended_by = std::max(own.ended_by, known[0]);
  own.checkpoint_due = own.checkpoint_due || known[1] != 0;
}

} // namespace

const std::string& launched_rank()
{
  return rank_by_launcher;
}

void end_with_launcher()
{
  if (rank_by_launcher.empty()) return;
  const pid_t launcher = getppid();
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != launcher) _exit(1); // it died in between
}

void begin_run_control(const RunLimits& limits)
{
  control().limits = limits;
  for (const auto& [number, name] : ending_signals) std::signal(number, note_signal);
  if (ignores_hangup) std::signal(SIGHUP, SIG_IGN);
}

bool end_is_asked(MPI_Comm comm)
{
  Control& own = control();
  if (own.undisturbed) return false;
  int ranks = 1, all = 1;
  MPI_Comm_size(comm, &ranks);
  MPI_Comm_size(MPI_COMM_WORLD, &all);
  if (ranks < all) return false; // the other ranks would not know, and would agree at another time
  agree_on_requests(comm);
  return own.ended_by != 0;
}

Finally undisturbed()
{
  control().undisturbed = true;
  return Finally([] { control().undisturbed = false; });
}

Finally without_sigterm()
{
  sigset_t term, before;
  sigemptyset(&term);
  sigaddset(&term, SIGTERM);
  sigprocmask(SIG_BLOCK, &term, &before);
  return Finally([before] { sigprocmask(SIG_SETMASK, &before, nullptr); });
}

void join_parts(MPI_Comm comm)
{
  control().checkpoint_due = false; // of one part alone
  agree_on_requests(comm);
  if (control().ended_by != 0) throw Interrupted{};
}

bool is_asked_here()
{
  return !control().undisturbed && (signal_received != 0 || time_is_up());
}

void end_if_asked(MPI_Comm comm)
{
  if (end_is_asked(comm)) throw Interrupted{};
}

bool checkpoint_is_due()
{
  return control().checkpoint_due;
}

bool checkpoint_is_worth_it(MPI_Comm comm)
{
  int worth = seconds_since(control().last_checkpoint) > 0.1 * control().limits.checkpoint_interval;
  MPI_Bcast(&worth, 1, MPI_INT, 0, comm);
  return worth != 0;
}

void checkpoint_made()
{
  control().checkpoint_due = false;
  control().last_checkpoint = Clock::now();
}

std::string who_asked_to_end()
{
  const int cause = control().ended_by;
  if (cause == 0) return {};
  if (cause == by_time_limit) return "by the time limit";
  const auto* const found = std::ranges::find(ending_signals, cause, &std::pair<int, const char*>::first);
  return std::string("by ") + found->second;
}

} // namespace squeal
