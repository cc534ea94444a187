/// Anderson's acceleration of the corrections.
#include "fitting.hpp"

namespace squeal
{

Candidate next_candidate(Acceleration& acceleration, Candidate from, Candidate to)
{
  auto& tried = acceleration.tried;
  tried.emplace_front(std::move(from), std::move(to));
  if (tried.size() > acceleration.memory) tried.pop_back();
  const Flow norm = acceleration.full.norm();
  const auto move = [](const std::pair<Candidate, Candidate>& pair)
  {
    Owned<Vec> result = copy_of(pair.second.state.get());
    check(VecAXPY(result, -1, pair.first.state));
    return result;
  };
  // least squares on the differences of moves; T counts through the states
  const Owned<Vec> latest = move(tried.front());
  std::vector<Owned<Vec>> differences;
  for (std::size_t i = 1; i < tried.size(); ++i)
  {
    differences.push_back(copy_of(latest.get()));
    check(VecAXPY(differences.back(), -1, move(tried[i])));
  }
  const auto n = static_cast<Eigen::Index>(differences.size());
  Candidate result{copy_of(tried.front().second.state.get()), tried.front().second.period};
  if (n == 0) return result;
  Eigen::MatrixXd A(n, n);
  Eigen::VectorXd b(n);
  for (Eigen::Index i = 0; i < n; ++i)
  {
    b(i) = energy_product(norm, differences[static_cast<std::size_t>(i)], latest);
    for (Eigen::Index j = 0; j <= i; ++j)
      A(i, j) = A(j, i) =
          energy_product(norm, differences[static_cast<std::size_t>(i)], differences[static_cast<std::size_t>(j)]);
  }
  A.diagonal() *= 1 + 1e-8;
  const Eigen::VectorXd weight = A.ldlt().solve(b);
  for (Eigen::Index i = 0; i < n; ++i)
  {
    const Candidate& old = tried[static_cast<std::size_t>(i) + 1].second;
    check(VecAXPY(result.state, weight(i), old.state));
    check(VecAXPY(result.state, -weight(i), tried.front().second.state));
    result.period += weight(i) * (old.period - tried.front().second.period);
  }
  return result;
}

} // namespace squeal
