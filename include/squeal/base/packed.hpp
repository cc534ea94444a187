#pragma once
/// Values of any structure as bytes of CBOR, for messages. A struct lists its members once, by
/// NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE.
#include "squeal/base/broadcast.hpp"

#include <nlohmann/json.hpp>
#include <string>

namespace squeal
{

template <class Value> std::string packed(const Value& value)
{
  std::string bytes;
  nlohmann::json::to_cbor(value, bytes);
  return bytes;
}

template <class Value> Value unpacked(const std::string& bytes)
{
  return nlohmann::json::from_cbor(bytes).template get<Value>();
}

/// Gives every rank the value of rank 0. Collective.
template <class Value> void broadcast_packed(Value& value, MPI_Comm comm)
{
  std::string bytes = packed(value);
  broadcast(bytes, comm);
  value = unpacked<Value>(bytes);
}

} // namespace squeal
