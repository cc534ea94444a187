#pragma once
/// Parts of the checks that involve several keys.
#include "squeal/base/error.hpp"
#include "toml_values.hpp"

#include <algorithm>

namespace squeal
{

/// A scene and the places of its values; each check throws Error with the place of the wrong one.
class SceneChecker
{
protected:
  SceneChecker(const Scene& scene, const Places& places)
      : scene_(scene), places_(places), points_(names_of(scene.points)), nodes_(points_)
  {
    for (const auto& names : {names_of(scene.rigid_bodies), names_of(scene.couplings)})
      nodes_.insert(nodes_.end(), names.begin(), names.end());
  }

  [[noreturn]] void fail(const void* member, const std::string& text) const { places_.refuse(member, text); }

  /// Throws Error if a name is not known.
  void need_known(const std::string& name, const std::vector<std::string>& known, const void* member,
                  const std::string& key) const
  {
    if (std::ranges::find(known, name) == known.end())
      fail(member, key + " = \"" + name + "\" is not defined" + hint_or_list(name, known));
  }

  static constexpr double largest_cosine = 1e-6; // unit vectors written by hand have a few digits

  const Scene& scene_;
  const Places& places_;
  std::vector<std::string> points_, nodes_; // names; nodes: of rigid bodies and couplings, too
};

} // namespace squeal
