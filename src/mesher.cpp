/// squeal_mesher: reads a mesh, or meshes a geometry, with libgmsh. squeal starts it; see src/mesh/mesh_file.cpp.
///
///   squeal_mesher shut-in NAME SIZES DIVISIONS [parameter value]…   reads the file of this name in a sandbox
///   squeal_mesher free NAME SIZES DIVISIONS [parameter value]…      lets a geometry run what it holds
///
/// SIZES is a script that gives the sizes of elements, or an empty text. Where DIVISIONS of the mesh follow, the answer
/// has the places of new nodes on the geometry.
///
/// The answer goes to a descriptor of its own. This program knows no MPI.
///
/// The sandbox: seccomp refuses system calls, Landlock refuses files. Files that gmsh does not recognise are scripts to
/// it, which can run commands and write files. A new process ends the mesher with SIGSYS, so that
/// a command is a message and not a mesh without it. The other calls fail, because libraries make some of them for
/// reasons of their own.
#include "squeal/base/available_memory.hpp"
#include "squeal/mesh/file_mesh.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <gmsh.h>
#include <linux/landlock.h>
#include <new>
#include <sched.h>
#include <seccomp.h>
#include <stdexcept>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace
{

using namespace squeal;

/// Initialises libgmsh without output; it then defines the given parameters.
void initialise(int argc, char** argv)
{
  std::vector<std::string> arguments = {"squeal_mesher"};
  for (int i = 5; i + 1 < argc; i += 2) arguments.insert(arguments.end(), {"-setnumber", argv[i], argv[i + 1]});
  std::vector<char*> pointers;
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  gmsh::initialize(static_cast<int>(pointers.size()), pointers.data(), false);
  gmsh::option::setNumber("General.Terminal", 0);
}

/// Reads all nodes. Returns the index of each gmsh node tag; -1 for tags that are not used.
std::vector<int> read_nodes(FileMesh& mesh)
{
  std::vector<std::size_t> tags;
  std::vector<double> coordinates, parametric;
  gmsh::model::mesh::getNodes(tags, coordinates, parametric);
  std::vector<int> index_of(tags.empty() ? 0 : *std::max_element(tags.begin(), tags.end()) + 1, -1);
  for (std::size_t i = 0; i < tags.size(); ++i)
  {
    index_of[tags[i]] = static_cast<int>(i);
    mesh.nodes.push_back({coordinates[3 * i], coordinates[3 * i + 1], coordinates[3 * i + 2]});
  }
  return index_of;
}

/// Names of the physical groups that an entity belongs to.
std::vector<std::string> groups_of(int dimension, int entity)
{
  std::vector<int> tags;
  gmsh::model::getPhysicalGroupsForEntity(dimension, entity, tags);
  std::vector<std::string> names;
  for (const int tag : tags)
  {
    std::string name;
    gmsh::model::getPhysicalName(dimension, std::abs(tag), name);
    names.push_back(name.empty() ? std::to_string(std::abs(tag)) : name);
  }
  return names;
}

void read_blocks(const std::vector<int>& index_of, FileMesh& mesh)
{
  gmsh::vectorpair entities;
  gmsh::model::getEntities(entities);
  for (const auto& [dimension, entity] : entities)
  {
    std::vector<int> types;
    std::vector<std::vector<std::size_t>> elements, nodes;
    gmsh::model::mesh::getElements(types, elements, nodes, dimension, entity);
    for (std::size_t k = 0; k < types.size(); ++k)
    {
      ElementBlock block{dimension, types[k], {}, 0, {}, groups_of(dimension, entity)};
      int order = 0, primary = 0, d = 0;
      std::vector<double> local;
      gmsh::model::mesh::getElementProperties(types[k], block.type_name, d, order, block.nodes_per_element, local,
                                              primary);
      for (const std::size_t tag : nodes[k])
      {
        if (tag >= index_of.size() || index_of[tag] < 0)
          throw std::runtime_error("an element has node " + std::to_string(tag) + ", which the file does not define");
        block.nodes.push_back(index_of[tag]);
      }
      mesh.blocks.push_back(std::move(block));
    }
  }
}

/// Whether the file brought elements of surfaces or volumes.
bool has_elements()
{
  std::vector<int> surfaces, volumes; // their types
  gmsh::model::mesh::getElementTypes(surfaces, 2);
  gmsh::model::mesh::getElementTypes(volumes, 3);
  return !surfaces.empty() || !volumes.empty();
}

/// Merges a script of sizes, which finds the tags of named volumes as its numbers "Volumes/NAME".
void take_sizes(const std::string& file)
{
  gmsh::vectorpair groups;
  gmsh::model::getPhysicalGroups(groups, 3);
  for (const auto& [dimension, group] : groups)
  {
    std::string name;
    gmsh::model::getPhysicalName(dimension, group, name);
    gmsh::onelab::setNumber("Volumes/" + name, {static_cast<double>(group)});
  }
  gmsh::merge(file);
}

/// Reads the middles of edges and faces on curves and surfaces of the geometry, where gmsh puts the nodes of second
/// order. Those of straight sides are left out.
void read_middles(FileMesh& mesh)
{
  constexpr double straight = 1e-6; // of half an edge
  FileMesh curved;                  // its nodes have other numbers, its elements the same order
  gmsh::model::mesh::setOrder(2);
  read_blocks(read_nodes(curved), curved);
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b)
  {
    const ElementBlock &block = mesh.blocks[b], &second = curved.blocks.at(b);
    const int corners = block.nodes_per_element, all = second.nodes_per_element;
    if (block.type > 3) continue; // lines, triangles and quadrangles of first order are 1 to 3
    for (int node = 0; node < static_cast<int>(second.nodes.size()); ++node)
    {
      const int first = node / all * corners, middle = node % all - corners;
      if (middle < 0) continue;
      NodeWeights parents;
      Vec3 mean{};
      const int from = middle == 4 ? 0 : middle,
                between = middle == 4 ? 4 : 2; // the fifth one of a quadrangle is its own
      for (int corner = from; corner < from + between; ++corner)
      {
        parents.emplace_back(block.nodes[first + corner % corners], 1. / between);
        mean = mean + parents.back().second * mesh.nodes[parents.back().first];
      }
      const Vec3& place = curved.nodes[second.nodes[node]];
      if (norm(place - mean) <= straight * norm(mesh.nodes[parents[0].first] - mean)) continue;
      std::sort(parents.begin(), parents.end());
      mesh.middles[parents] = place;
    }
  }
}

FileMesh read_or_generate(const std::string& file, const std::string& sizes, bool is_divided)
{
  gmsh::open(file);
  if (!sizes.empty()) take_sizes(sizes);
  const bool is_geometry = !has_elements();
  if (is_geometry) gmsh::model::mesh::generate(3);
  std::string problem;
  gmsh::logger::getLastError(problem);
  if (!problem.empty()) throw std::runtime_error(problem);
  FileMesh mesh;
  read_blocks(read_nodes(mesh), mesh);
  if (is_geometry && is_divided) read_middles(mesh);
  return mesh;
}

MesherAnswer answer_of(int argc, char** argv)
{
  MesherAnswer answer;
  try
  {
    initialise(argc, argv);
    answer.mesh = read_or_generate(argv[2], argv[3], argv[4] != std::string("0"));
  }
  catch (const std::string& text) // libgmsh before 4.9 throws strings
  {
    answer.problem = text;
  }
  catch (const std::bad_alloc&)
  {
    answer.problem = "memory ran out: the mesh is larger than this machine holds, or the file is corrupt";
  }
  catch (const std::exception& error)
  {
    answer.problem = error.what();
  }
  return answer;
}

/// Leaves a fifth of the free memory to the others, so that a mesh that is too fine ends the mesher alone.
[[maybe_unused]] void limit_memory()
{
  const double available = available_memory();
  rlimit limit{};
  if (std::isinf(available) || getrlimit(RLIMIT_AS, &limit) != 0) return;
  limit.rlim_cur = std::min(limit.rlim_cur, static_cast<rlim_t>(0.8 * available));
  (void)setrlimit(RLIMIT_AS, &limit);
}

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

/// Shuts this process in, for good: it starts no program and no other process, opens no connection, and neither writes
/// nor changes a file. What is open stays open. Returns what the kernel leaves open, for a message; empty if nothing.
/// To be called before the process makes threads of its own.
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

} // namespace

int main(int argc, char** argv)
{
  if (argc < 5) return 2;
  prctl(PR_SET_PDEATHSIG, SIGKILL); // with squeal it ends too
#ifndef __SANITIZE_ADDRESS__        // it reserves more addresses than there are bytes
  limit_memory();
#endif
  for (int inherited = answer_descriptor + 1; inherited < 1024; ++inherited) close(inherited); // MPI's
  const std::string open = argv[1] == std::string(shut_in_mesher) ? shut_in() : "";
  MesherAnswer answer = answer_of(argc, argv);
  answer.left_open = open;
  const std::string bytes = packed(answer);
  for (std::size_t sent = 0; sent < bytes.size();)
  {
    const ssize_t size = write(answer_descriptor, bytes.data() + sent, bytes.size() - sent);
    if (size < 0) return 3;
    sent += static_cast<std::size_t>(size);
  }
  _exit(0); // libgmsh's own clean-up has crashed after good meshes
}
