#include "nested_dissection.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/base/error.hpp"
#include "squeal/base/petsc.hpp"
#include "squeal/base/run_control.hpp"

#include <array>
#include <utility>

namespace squeal
{

namespace
{

constexpr int worth_dividing = 2000; // nodes: METIS orders them in the time of some messages

std::size_t at(idx_t number)
{
  return static_cast<std::size_t>(number);
}

std::vector<idx_t> metis_options()
{
  std::vector<idx_t> options(METIS_NOPTIONS);
  METIS_SetDefaultOptions(options.data());
  options[METIS_OPTION_COMPRESS] = 0; // the nodes are compressed
  return options;
}

/// By METIS on this rank; nothing if it fails.
std::vector<idx_t> positions_of(WeightedGraph& part)
{
  auto& [graph, weights] = part;
  std::vector<idx_t> order(weights.size()), position(weights.size()), options = metis_options();
  idx_t size = graph.nodes();
  if (size == 0) return position;
  graph.neighbours.reserve(1); // METIS takes no null pointer
  const auto dissect = [&]
  {
    return METIS_NodeND(&size, graph.offsets.data(), graph.neighbours.data(), weights.data(), options.data(),
                        order.data(), position.data());
  };
  if (without_losing_signals(METIS_OK, dissect) != METIS_OK) position.clear();
  return position;
}

/// Two parts of a graph and the separator between them.
struct Division
{
  std::vector<idx_t> part{};           // of each node: 0, 1, or 2 for the separator
  std::array<WeightedGraph, 2> halves; // nodes in their order
};

/// Where METIS fails, and where little is to be divided, the first half is the whole graph: METIS divides by zero
/// without nodes, which dense graphs leave of a half.
Division divided(WeightedGraph whole)
{
  auto& [graph, weights] = whole;
  Division division{std::vector<idx_t>(weights.size(), 0), {}};
  std::vector<idx_t> options = metis_options();
  idx_t size = graph.nodes(), separator = 0;
  graph.neighbours.reserve(1);
  const auto divide = [&]
  {
    return METIS_ComputeVertexSeparator(&size, graph.offsets.data(), graph.neighbours.data(), weights.data(),
                                        options.data(), &separator, division.part.data());
  };
  if (size < worth_dividing || without_losing_signals(METIS_OK, divide) != METIS_OK)
  {
    division.part.assign(weights.size(), 0);
    division.halves[0] = std::move(whole);
    return division;
  }
  std::array<idx_t, 3> count{};
  std::vector<idx_t> number(weights.size());
  for (std::size_t node = 0; node < number.size(); ++node) number[node] = count[at(division.part[node])]++;
  for (idx_t node = 0; node < size; ++node)
  {
    const idx_t part = division.part[at(node)];
    if (part == 2) continue;
    WeightedGraph& half = division.halves[at(part)];
    for (const idx_t neighbour : graph.of(node))
      if (division.part[at(neighbour)] == part) half.graph.neighbours.push_back(number[at(neighbour)]);
    half.graph.offsets.push_back(static_cast<idx_t>(half.graph.neighbours.size()));
    half.weights.push_back(weights[at(node)]);
  }
  return division;
}

/// The first half, the second one, and the separator at last; nothing if a half has no positions.
std::vector<idx_t> joined(const std::vector<idx_t>& part, const std::array<std::vector<idx_t>, 2>& of_halves)
{
  std::array<std::size_t, 3> count{};
  for (const idx_t here : part) ++count[at(here)];
  if (of_halves[0].size() != count[0] || of_halves[1].size() != count[1]) return {};
  const std::array<std::size_t, 3> first{0, count[0], count[0] + count[1]};
  std::array<std::size_t, 3> next{};
  std::vector<idx_t> position;
  for (const idx_t here : part)
  {
    const std::size_t k = next[at(here)]++;
    position.push_back(static_cast<idx_t>(first[at(here)]) +
                       (here == 2 ? static_cast<idx_t>(k) : of_halves[at(here)][k]));
  }
  return position;
}

/// Orders the graph of rank `first` with the ranks before `last`; the positions are there. The others would wait for
/// ever for one that left by an exception: that ends the program.
std::vector<idx_t> dissect(WeightedGraph own, int first, int last, MPI_Comm comm) noexcept
{
  if (last - first == 1) return positions_of(own);
  const int me = rank_of(comm), middle = (first + last) / 2;
  if (me < middle)
  {
    Division division;
    if (me == first)
    {
      division = divided(std::move(own));
      WeightedGraph& other = division.halves[1];
      for (const auto* numbers : {&other.graph.offsets, &other.graph.neighbours, &other.weights})
        send(*numbers, middle, comm);
      other = {};
    }
    std::vector<idx_t> position = dissect(std::move(division.halves[0]), first, middle, comm);
    if (me != first) return position;
    std::vector<idx_t> of_other;
    receive(of_other, middle, comm);
    return joined(division.part, {std::move(position), std::move(of_other)});
  }
  if (me == middle)
    for (auto* numbers : {&own.graph.offsets, &own.graph.neighbours, &own.weights}) receive(*numbers, first, comm);
  std::vector<idx_t> position = dissect(std::move(own), middle, last, comm);
  if (me == middle) send(position, first, comm);
  return {};
}

} // namespace

std::vector<idx_t> nested_dissection(WeightedGraph whole, MPI_Comm comm)
{
  const int me = rank_of(comm), nodes = whole.graph.nodes();
  int taking_part = nodes < worth_dividing ? 1 : ranks_of(comm);
  MPI_Bcast(&taking_part, 1, MPI_INT, 0, comm);
  std::vector<idx_t> position;
  if (me < taking_part) position = dissect(std::move(whole), 0, taking_part, comm);
  on_rank_zero(comm,
               [&]
               {
                 if (to_int(position.size()) != nodes) throw LibraryError("METIS found no elimination order");
               });
  return position;
}

} // namespace squeal
