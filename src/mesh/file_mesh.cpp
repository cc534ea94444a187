/// Packing of a mesh into bytes: sizes and contents in the order of the members, between two magic words.
#include "squeal/mesh/file_mesh.hpp"

#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <type_traits>

namespace squeal
{

namespace
{

/// Appends what it passes to bytes.
class Writer
{
public:
  void pass(const void* values, std::size_t size) { bytes.append(static_cast<const char*>(values), size); }
  void check(std::uint64_t) const {}

  std::string bytes{};
};

/// Sets what it passes from bytes.
class Reader
{
public:
  explicit Reader(const std::string& bytes) : bytes_(bytes) {}

  void pass(void* values, std::size_t size)
  {
    check(size);
    if (size > 0) std::memcpy(values, bytes_.data() + place_, size);
    place_ += size;
  }

  /// Throws if fewer bytes are left.
  void check(std::uint64_t size) const
  {
    if (size > bytes_.size() - place_) throw std::runtime_error("it is no whole mesh");
  }

private:
  const std::string& bytes_;
  std::size_t place_ = 0;
};

template <class Archive> void pass(Archive& archive, int& value)
{
  archive.pass(&value, sizeof value);
}

template <class Archive> void pass(Archive& archive, ElementBlock& block);

template <class Archive, class List> void pass(Archive& archive, List& list)
{
  using Value = typename List::value_type;
  constexpr bool is_plain = std::is_trivially_copyable_v<Value>;
  std::uint64_t size = list.size();
  archive.pass(&size, sizeof size);
  archive.check(size); // each value has a byte and more
  if constexpr (is_plain) archive.check(size * sizeof(Value));
  list.resize(size);
  if constexpr (is_plain)
    archive.pass(list.data(), size * sizeof(Value));
  else
    for (Value& value : list) pass(archive, value);
}

template <class Archive> void pass(Archive& archive, ElementBlock& block)
{
  pass(archive, block.dimension);
  pass(archive, block.type);
  pass(archive, block.type_name);
  pass(archive, block.nodes_per_element);
  pass(archive, block.nodes);
  pass(archive, block.groups);
}

template <class Archive> void pass(Archive& archive, MesherAnswer& answer)
{
  constexpr std::uint64_t magic = 0x3168'7365'6d71'7371; // at the end as well, so that a cut answer is noticed
  std::uint64_t begin = magic, end = magic;
  archive.pass(&begin, sizeof begin);
  pass(archive, answer.problem);
  pass(archive, answer.left_open);
  pass(archive, answer.mesh.nodes);
  pass(archive, answer.mesh.blocks);
  archive.pass(&end, sizeof end);
  if (begin != magic || end != magic) throw std::runtime_error("it is no mesh");
}

} // namespace

std::string packed(MesherAnswer answer)
{
  Writer writer;
  pass(writer, answer);
  return std::move(writer.bytes);
}

MesherAnswer unpacked(const std::string& bytes)
{
  Reader reader(bytes);
  MesherAnswer answer;
  pass(reader, answer);
  return answer;
}

} // namespace squeal
