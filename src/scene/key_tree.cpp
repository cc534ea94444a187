/// Headings, labels and absent values of the tree of keys.
#include "scene_keys.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>

namespace squeal
{

std::string heading_of(const SceneKey& table)
{
  const TableForm form = std::get<TableTarget>(table.target).form;
  if (form == TableForm::list) return "[[" + table.name + "]]";
  return form == TableForm::single ? "[" + table.name + "]" : table.name;
}

std::string label_of(const SceneKey& table, const std::string& name, const std::string& label)
{
  return label + heading_of(table) + " " + (name.empty() ? "" : shortened(name) + " ");
}

bool is_absent(const SceneKey& key)
{
  const auto of_value = [&](const auto& value) -> bool
  {
    using Value = std::remove_cvref_t<decltype(value)>;
    if constexpr (std::is_same_v<Value, Vec3>)
      return (key.rule == Rule::direction || key.rule == Rule::velocity) && value == Vec3{};
    else if constexpr (std::is_same_v<Value, TimeFactor>)
      return value.time.empty();
    else if constexpr (requires { value.has_value(); })
      return !value.has_value();
    else if constexpr (requires { value.empty(); } && !std::is_same_v<Value, std::string>)
      return value.empty();
    return false;
  };
  const auto of_target = [&](const auto& target) -> bool
  {
    using Kind = std::remove_cvref_t<decltype(target)>;
    if constexpr (std::is_pointer_v<Kind>) return of_value(*target);
    if constexpr (requires { target.part; }) return !target.part->has_value();
    if constexpr (std::is_same_v<Kind, TableTarget>) return target.size() == 0;
    return false;
  };
  return std::visit(of_target, key.target);
}

bool has_unit(const std::string& unit)
{
  static const std::vector<std::string> none = {"-", "text", "texts", "word", "path", "switch", "motions", "table"};
  return std::find(none.begin(), none.end(), unit) == none.end();
}

} // namespace squeal
