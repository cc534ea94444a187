/// The mesher's sandbox: seccomp refuses system calls, Landlock refuses files.
///
/// gmsh takes every file for a script that it does not recognise, and its scripts can run commands and write files.
/// A new process ends the mesher with SIGSYS, so that a command is a message and not a mesh without it. The other calls
/// fail, because libraries make some of them for reasons of their own.
#include "squeal/mesh/sandbox.hpp"

#include <array>
#include <cerrno>
#include <linux/landlock.h>
#include <sched.h>
#include <seccomp.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace squeal
{

namespace
{

constexpr std::array ending_calls = {SCMP_SYS(execve), SCMP_SYS(execveat), SCMP_SYS(fork), SCMP_SYS(vfork)};
constexpr std::array failing_calls = {
    SCMP_SYS(socket),      SCMP_SYS(socketpair), SCMP_SYS(connect),        SCMP_SYS(bind),
    SCMP_SYS(ptrace),      SCMP_SYS(truncate),   SCMP_SYS(io_uring_setup), SCMP_SYS(process_vm_writev),
    SCMP_SYS(chmod),       SCMP_SYS(fchmod),     SCMP_SYS(fchmodat),       SCMP_SYS(chown),
    SCMP_SYS(fchown),      SCMP_SYS(lchown),     SCMP_SYS(fchownat),       SCMP_SYS(setxattr),
    SCMP_SYS(lsetxattr),   SCMP_SYS(fsetxattr),  SCMP_SYS(utime),          SCMP_SYS(utimes),
    SCMP_SYS(futimesat),   SCMP_SYS(utimensat),  SCMP_SYS(removexattr),    SCMP_SYS(lremovexattr),
    SCMP_SYS(fremovexattr)};

/// Returns whether the kernel took the filter of system calls, for all threads.
bool filter_calls()
{
  const scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ALLOW);
  if (!filter) return false;
  bool good = seccomp_attr_set(filter, SCMP_FLTATR_CTL_TSYNC, 1) == 0;
  for (const int call : ending_calls) good = good && seccomp_rule_add(filter, SCMP_ACT_KILL_PROCESS, call, 0) == 0;
  for (const int call : failing_calls) good = good && seccomp_rule_add(filter, SCMP_ACT_ERRNO(EACCES), call, 0) == 0;
  // clone makes threads as well; clone3 hides its flags, and libraries then take clone.
  const scmp_arg_cmp is_process = SCMP_A0_64(SCMP_CMP_MASKED_EQ, CLONE_THREAD, 0);
  good = good && seccomp_rule_add_array(filter, SCMP_ACT_KILL_PROCESS, SCMP_SYS(clone), 1, &is_process) == 0 &&
         seccomp_rule_add(filter, SCMP_ACT_ERRNO(ENOSYS), SCMP_SYS(clone3), 0) == 0 && seccomp_load(filter) == 0;
  seccomp_release(filter);
  return good;
}

/// Returns whether the kernel keeps this process from running, writing, making and removing files.
bool protect_files()
{
  landlock_ruleset_attr refused{};
  refused.handled_access_fs =
      LANDLOCK_ACCESS_FS_EXECUTE | LANDLOCK_ACCESS_FS_WRITE_FILE | LANDLOCK_ACCESS_FS_REMOVE_DIR |
      LANDLOCK_ACCESS_FS_REMOVE_FILE | LANDLOCK_ACCESS_FS_MAKE_CHAR | LANDLOCK_ACCESS_FS_MAKE_DIR |
      LANDLOCK_ACCESS_FS_MAKE_REG | LANDLOCK_ACCESS_FS_MAKE_SOCK | LANDLOCK_ACCESS_FS_MAKE_FIFO |
      LANDLOCK_ACCESS_FS_MAKE_BLOCK | LANDLOCK_ACCESS_FS_MAKE_SYM; // every kernel with Landlock knows these
  const long rules = syscall(SYS_landlock_create_ruleset, &refused, sizeof refused, 0);
  if (rules < 0) return false;
  const bool good = syscall(SYS_landlock_restrict_self, rules, 0) == 0;
  close(static_cast<int>(rules));
  return good;
}

} // namespace

std::string shut_in()
{
  const rlimit none{};
  (void)setrlimit(RLIMIT_CORE, &none); // the kernel would write it
  prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
  const bool files = protect_files(), calls = filter_calls();
  std::string open;
  if (!files) open = "it can write files (no Landlock)";
  if (!calls) open += std::string(open.empty() ? "" : ", ") + "it can start programs and open connections (no seccomp)";
  return open;
}

} // namespace squeal
