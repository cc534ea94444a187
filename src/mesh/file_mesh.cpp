#include "squeal/mesh/file_mesh.hpp"

#include <nlohmann/json.hpp>

namespace squeal
{

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ElementBlock, dimension, type, type_name, nodes_per_element, nodes, groups)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(FileMesh, nodes, blocks, middles)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(MesherAnswer, mesh, problem, left_open)

std::string packed(const MesherAnswer& answer)
{
  std::string bytes;
  nlohmann::json::to_cbor(answer, bytes);
  return bytes;
}

MesherAnswer unpacked(const std::string& bytes)
{
  return nlohmann::json::from_cbor(bytes);
}

} // namespace squeal
