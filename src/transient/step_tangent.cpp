/// A column is a motion without load and drive whose contact is linear. With M dv, A dv and K du at hand a step solves
///     A dv_f = [M dv - (1-theta) A dv]/theta - h K du,      A dv+ = A dv_f + h B' dr,
/// and A dv+ is the right-hand side just solved for, as in the step itself.
#include "squeal/algebra/multivector.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/error.hpp"
#include "squeal/base/free_memory.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/solid/structure.hpp"
#include "squeal/transient/linear_contact.hpp"
#include "squeal/transient/theta_step.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

constexpr std::size_t at_once = 64; // columns: their work vectors take ten times a column's memory

/// The products of the columns at a step's start, and its work vectors.
struct TangentWork
{
  std::vector<Owned<Vec>> Mv, Av, Ku, v_next, scratch;
};

std::vector<Vec> handles(const std::vector<Owned<Vec>>& vectors)
{
  return {vectors.begin(), vectors.end()};
}

TangentWork begin_tangents(const ThetaStep& step, const Structure& structure, std::span<const TangentColumn> columns)
{
  TangentWork work;
  std::vector<Vec> u, v;
  for (const TangentColumn& column : columns)
  {
    u.push_back(column.u);
    v.push_back(column.v);
    for (auto* vectors : {&work.Mv, &work.Av, &work.Ku, &work.v_next, &work.scratch})
      vectors->push_back(zeros_like(structure.load));
  }
  const double theta_h = step.theta * step.h;
  const std::vector<Vec> Mv = handles(work.Mv), Av = handles(work.Av), Ku = handles(work.Ku),
                         Kv = handles(work.scratch);
  multiply_mass_and_stiffness(step, structure, {v, u}, {Mv, Ku});
  product(structure.C, v, Av);
  product(structure.K, v, Kv);
  for (std::size_t k = 0; k < columns.size(); ++k)
    check(VecAXPBYPCZ(Av[k], 1, theta_h * theta_h, theta_h, Mv[k], Kv[k]));
  return work;
}

/// db_n of a pair but B_n dv_f, by a change of its gap at ut [m] and of B_n v [m/s].
double change_of_gap_rate(const ThetaStep& step, double compliance, double moved, double rate)
{
  const double h = step.h;
  if (compliance == 0) return moved / h;
  const CompliantGap law = compliant_gap(compliance, step.theta, h);
  return law.by_gap * (moved - h * (1 - step.theta) * rate) + law.by_rate * rate; // the gap's change at u
}

/// db of every column but B dv_f, on every rank.
MatrixXd contact_of_start(const ThetaStep& step, const Interface& interface, const StepRecord& record,
                          std::span<const TangentColumn> columns, const TangentWork& work)
{
  const double past = (1 - step.theta) / step.theta;
  MatrixXd db = MatrixXd::Zero(static_cast<Index>(interface.size()), static_cast<Index>(columns.size()));
  std::vector<Vec> start;
  for (std::size_t k = 0; k < columns.size(); ++k)
  {
    check(VecWAXPY(work.scratch[k], step.h * (1 - step.theta), columns[k].v, columns[k].u)); // of ut
    start.insert(start.end(), {work.scratch[k], columns[k].v});
  }
  const std::vector<std::vector<double>> motion = relative(interface, start);
  for (std::size_t k = 0; k < columns.size(); ++k)
  {
    const PairView moved(motion[2 * k], interface.directions), s(motion[2 * k + 1], interface.directions);
    auto column = db.col(static_cast<Index>(k));
    const PairView<double> change(column, interface.directions);
    for (std::size_t pair = 0; pair < change.pairs(); ++pair)
    {
      change.normal(pair) =
          change_of_gap_rate(step, compliance_of(interface, pair), moved.normal(pair), s.normal(pair));
      if (!record.opposes_theta[pair]) continue;
      for (std::size_t d = 0; d < s.tangential(pair).size(); ++d)
        change.tangential(pair)[d] = past * s.tangential(pair)[d];
    }
  }
  return db;
}

/// The step whose tangent is taken.
struct RecordedStep
{
  const ThetaStep& step;
  const Structure& structure;
  const Interface& interface;
  const StepRecord& record;
  std::span<const double> W; // all entries, on rank 0
  double& room;              // [byte] for what is kept of contact, on rank 0
};

/// The step's contact: the record's own, else a new one, which is kept there as long as there is room.
std::shared_ptr<const LinearContact> contact_of_step(const RecordedStep& of, const Eigen::Map<const MatrixXd>& W)
{
  if (of.record.linear) return of.record.linear;
  auto contact = std::make_shared<const LinearContact>(
      W, ContactLaw{of.interface.directions, of.interface.friction, of.step.theta}, of.record);
  of.room -= contact->memory();
  if (of.room > 0) of.record.linear = contact;
  return contact;
}

/// dr of every column, on every rank. `Bv_free`: B dv_f of each, on rank 0.
MatrixXd reactions(const RecordedStep& of, std::span<const TangentColumn> columns, MatrixXd db,
                   const std::vector<double>& Bv_free)
{
  const auto& [step, structure, interface, record, entries, room] = of;
  MatrixXd dr = MatrixXd::Zero(db.rows(), db.cols());
  const auto find = [&]
  {
    const Eigen::Map<const MatrixXd> W(entries.data(), db.rows(), db.rows());
    const auto contact = contact_of_step(of, W);
    if (contact->is_open()) return;
    db += MatrixXd::Map(Bv_free.data(), db.rows(), db.cols());
    Eigen::RowVectorXd dmu(db.cols());
    for (Index k = 0; k < dmu.size(); ++k) dmu(k) = columns[static_cast<std::size_t>(k)].friction;
    const VectorXd& of_coefficient = contact->by_coefficient();
    if (!dmu.isZero(0)) db += W * of_coefficient * dmu;
    dr = contact->reactions(contact->solve(contact->rows_of(db))) + of_coefficient * dmu;
  };
  on_rank_zero(comm_of(interface.B), find);
  MPI_Bcast(dr.data(), to_int(dr.size()), MPI_DOUBLE, 0, comm_of(interface.B));
  return dr;
}

/// dv+ of every column from A dv_f in Av, with the contact that `db` starts from; Av becomes A dv+.
void solve_columns(const RecordedStep& of, std::span<const TangentColumn> columns, MatrixXd db, TangentWork& work)
{
  const auto& [step, structure, interface, record, W, room] = of;
  const std::vector<Vec> Av = handles(work.Av);
  MatrixXd dr = MatrixXd::Zero(0, 0);
  const std::vector<double> Bv_free = step.factor.forward(Av);
  std::vector<double> lambda;
  if (interface.pairs > 0)
  {
    dr = step.h * reactions(of, columns, std::move(db), Bv_free);
    for (std::size_t k = 0; k < columns.size(); ++k)
    {
      const double* const impulse = dr.col(static_cast<Index>(k)).data();
      add_reactions(interface, {impulse, impulse + dr.rows()}, Av[k]);
    }
    dr = -dr;
    lambda.assign(dr.data(), dr.data() + dr.size());
  }
  step.factor.backward(lambda, handles(work.v_next));
}

void one_step(const RecordedStep& of, std::span<TangentColumn> columns, TangentWork& work)
{
  const auto& [step, structure, interface, record, W, room] = of;
  const double h = step.h, theta = step.theta;
  const std::vector<Vec> Av = handles(work.Av), v_next = handles(work.v_next);
  MatrixXd db;
  if (interface.pairs > 0) db = contact_of_start(step, interface, record, columns, work);
  for (std::size_t k = 0; k < columns.size(); ++k)
    check(VecAXPBYPCZ(Av[k], 1 / theta, -h, (theta - 1) / theta, work.Mv[k], work.Ku[k]));
  if (structure.G.get())
  {
    std::vector<Vec> v;
    for (const TangentColumn& column : columns) v.push_back(column.v);
    solve_with_gyroscopic_part(step, structure.G, {v, v_next, Av}, [&] { solve_columns(of, columns, db, work); });
  }
  else
    solve_columns(of, columns, std::move(db), work);
  for (std::size_t k = 0; k < columns.size(); ++k)
  {
    TangentColumn& column = columns[k];
    check(VecAXPBYPCZ(column.u, h * theta, h * (1 - theta), 1, v_next[k], column.v));
    check(VecCopy(v_next[k], column.v));
  }
  std::vector<Vec> u;
  for (const TangentColumn& column : columns) u.push_back(column.u);
  multiply_mass_and_stiffness(step, structure, {v_next, u}, {handles(work.Mv), handles(work.Ku)});
}

} // namespace

void advance_tangents(const ThetaStep& step, const Structure& structure, const Interface& interface,
                      std::span<const StepRecord> records, std::span<TangentColumn> columns)
{
  step.W.hold_whole();
  const std::span<const double> W = step.W.entries();
  constexpr double part = 0.25; // of the free memory
  double room = part * free_memory(comm_of(structure.load));
  for (std::size_t first = 0; first < columns.size(); first += at_once)
  {
    const auto batch = columns.subspan(first, std::min(at_once, columns.size() - first));
    TangentWork work = begin_tangents(step, structure, batch);
    for (const StepRecord& record : records)
    {
      one_step({step, structure, interface, record, W, room}, batch, work);
      end_if_asked(comm_of(structure.load));
    }
  }
}

namespace
{

std::string mode_refusal(const ComplexMode& mode, double theta, double h)
{
  const double sigma = mode.lambda.real(), omega = std::abs(mode.lambda.imag());
  if (theta == 0.5 || sigma <= 0) return {};
  const double steps = two_pi / (omega * h);
  const double needed = two_pi * std::abs(theta - 0.5) * std::norm(mode.lambda) / (omega * sigma);
  if (steps > needed) return {};
  return format("with theta = %.4g and %.4g steps a period the mode that grows at sigma = %.4g /s would ", theta, steps,
                sigma) +
         (theta > 0.5 ? "look stable: more than 2 pi (theta - 1/2) omega/sigma = "
                      : "owe most of its growth to the step: more than 2 pi (1/2 - theta) omega/sigma = ") +
         format("%.4g steps a period are needed, or theta = 1/2", needed);
}

/// A step size, below h, with one solution a step; 0 if there is none, as where a pair's nodes have no mass.
double step_with_one_solution(const SlidingEquilibrium& sliding, double theta, double h, double fall,
                              const StepOptions& options, double increase)
{
  constexpr int attempts = 8;
  for (int attempt = 0; attempt < attempts; ++attempt)
  {
    h *= 0.9 / fall; // W grows as h at most while h is large
    const ThetaStep step = make_theta_step(sliding.structure, sliding.interface, h, theta, options);
    const double now = increase * fall_of_friction(step, sliding.interface, sliding.equilibrium.reactions);
    if (now < 1) return h;
    if (now >= fall) return 0; // W grows as h falls
    fall = std::max(now, 1.5);
  }
  return 0;
}

} // namespace

std::complex<double> discrete_eigenvalue(std::complex<double> lambda, double theta, double h)
{
  return std::log((1. + (1 - theta) * h * lambda) / (1. - theta * h * lambda)) / h;
}

std::string step_refusal(const ComplexMode* mode, double theta, double h, const StepOptions& options)
{
  return options.refuse && mode ? mode_refusal(*mode, theta, h) : std::string();
}

double fall_of_friction(const ThetaStep& step, const Interface& interface, const std::vector<double>& reactions)
{
  constexpr int passes = 30; // of power iteration
  const PairFriction friction = law_of_step(interface.friction, step.theta);
  if (steepest_fall(friction) == 0 || interface.pairs == 0) return 0;
  std::vector<double> roots(interface.size(), 0.);
  const PairView<double> weights(roots, interface.directions);
  for (std::size_t i = 0; i < weights.pairs(); ++i)
    std::ranges::fill(
        weights.tangential(i),
        std::sqrt(steepest_fall(friction.of(i)) * std::max(0., PairView(reactions, interface.directions).normal(i))));
  double largest = 0; // 0 where W is not
  on_every_rank(comm_of(interface.B), [&] { largest = step.W.largest_eigenvalue(roots, passes); });
  MPI_Bcast(&largest, 1, MPI_DOUBLE, 0, comm_of(interface.B));
  return largest;
}

std::string friction_refusal(const SlidingEquilibrium& sliding, const ComplexMode* mode, double theta, double h,
                             const StepOptions& options, double increase)
{
  if (!options.refuse || steepest_fall(sliding.interface.friction) == 0) return {};
  const ThetaStep step = make_theta_step(sliding.structure, sliding.interface, h, theta, options);
  const double fall = increase * fall_of_friction(step, sliding.interface, sliding.equilibrium.reactions);
  if (fall < 1) return {};
  const std::string reason = format("friction falls so steeply with the speed that a step of %.4g s may have several "
                                    "solutions, |mu'| r_n W_t = %.4g: ",
                                    h, fall);
  const double enough = step_with_one_solution(sliding, theta, h, fall, options, increase);
  if (enough == 0)
    return reason + "no shorter step would do, since contact nodes have too little mass; raise friction.decay_speed";
  if (!mode) return reason + format("a step of %.4g s would do", enough);
  return reason + format("%.0f steps a period would do", std::ceil(two_pi / (std::abs(mode->lambda.imag()) * enough)));
}

} // namespace squeal
