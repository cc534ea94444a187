#include "squeal/reduction/model_files.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/base/whole_file.hpp"
#include "squeal/equilibrium/file_order.hpp"
#include "squeal/reduction/reduced_model.hpp"
#include "squeal/solid/binary.hpp"

#include <numeric>
#include <string>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;

/// With every pair active and none eliminated.
ReducedModel whole_model(const SlidingEquilibrium& sliding, const std::vector<ComplexMode>& modes,
                         const FactorOptions& factor)
{
  const auto pairs = static_cast<std::size_t>(sliding.interface.pairs);
  PairRoles roles{std::vector<int>(pairs), std::vector<char>(pairs, 0), sliding.equilibrium.reactions};
  std::iota(roles.active.begin(), roles.active.end(), 0);
  Reduction reduction;
  reduction.modes = static_cast<int>(modes.size());
  reduction.factor = factor;
  return reduce(sliding, modes, roles, reduction);
}

/// The shapes and u0 in the order of files, on rank 0. Collective.
std::string lift_back(const SlidingEquilibrium& sliding, const MultiVector& shapes, std::string& rest)
{
  const FileOrder order(sliding.structure);
  const Owned<Vec> column = zeros_like(sliding.equilibrium.u);
  std::string bytes;
  for (Index j = 0; j < shapes.columns(); ++j)
  {
    copy_column(shapes, j, column);
    append_vector(order.gather(column), bytes);
  }
  append_vector(order.gather(sliding.equilibrium.u), rest);
  return bytes;
}

/// On the shapes, skew to the last bit; empty without one.
MatrixXd gyroscopic_part(Mat G, const MultiVector& shapes)
{
  if (!G) return {};
  const MatrixXd whole = inner_products(shapes, product(G, shapes));
  return 0.5 * (whole - whole.transpose());
}

} // namespace

void write_reduced_matrices(const SlidingEquilibrium& sliding, const std::vector<ComplexMode>& modes,
                            const FactorOptions& factor, const std::filesystem::path& folder)
{
  const ReducedModel model = whole_model(sliding, modes, factor);
  std::string rest;
  const std::string shapes = lift_back(sliding, model.shapes, rest);
  const MatrixXd gyroscopic = gyroscopic_part(sliding.structure.G, model.shapes);
  const auto write = [&]
  {
    std::filesystem::create_directories(folder);
    const auto file = [&](const char* name, const std::string& bytes)
    { write_whole_file(folder / (std::string(name) + ".petsc"), bytes); };
    for (const auto& [name, matrix] :
         {std::pair{"M", &model.M_z}, std::pair{"C", &model.C_z}, std::pair{"K", &model.K_z}, std::pair{"B", &model.G},
          std::pair{"G", &gyroscopic}})
    {
      if (matrix->rows() == 0) continue; // no pairs, or no gyroscopic part
      std::string bytes;
      append_matrix(*matrix, bytes);
      file(name, bytes);
    }
    // the reactions of the equilibrium take its load
    const Eigen::VectorXd load =
        -model.G.transpose() *
        Eigen::Map<const Eigen::VectorXd>(model.reactions.data(), static_cast<Index>(model.reactions.size()));
    const std::vector<double> F(load.begin(), load.end());
    for (const auto& [name, vector] : {std::pair{"F", &F}, std::pair{"gap", &model.gap},
                                       std::pair{"drive", &model.drive}, std::pair{"compliance", &model.compliance}})
    {
      if (model.active.empty() && vector != &F) continue;
      if (vector == &model.compliance && sliding.interface.compliance.empty()) continue;
      std::string bytes;
      append_vector(*vector, bytes);
      file(name, bytes);
    }
    file("shapes", shapes);
    file("u0", rest);
  };
  on_rank_zero(comm_of(sliding.structure.load), write);
}

} // namespace squeal
