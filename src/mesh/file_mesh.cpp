/// Packing of a mesh into bytes: a magic word, then sizes and contents in the order of the members.
#include "squeal/mesh/file_mesh.hpp"

#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <type_traits>

namespace squeal
{

namespace
{

constexpr std::uint64_t magic = 0x3168'7365'6d71'7371; // also the end mark, so that a cut answer is noticed

class Writer
{
public:
  template <class T> void add(const T& value)
  {
    static_assert(std::is_trivially_copyable_v<T>);
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  }

  template <class List> void add_list(const List& list)
  {
    add<std::uint64_t>(list.size());
    bytes.append(reinterpret_cast<const char*>(list.data()), list.size() * sizeof(typename List::value_type));
  }

  std::string bytes;
};

class Reader
{
public:
  explicit Reader(const std::string& bytes) : bytes_(bytes) {}

  template <class T> T next()
  {
    T value;
    take(&value, sizeof value);
    return value;
  }

  template <class List> List next_list()
  {
    const auto size = next<std::uint64_t>();
    if (size > (bytes_.size() - place_) / sizeof(typename List::value_type)) throw std::runtime_error("it is cut off");
    List list(size, typename List::value_type{});
    take(list.data(), size * sizeof(typename List::value_type));
    return list;
  }

private:
  void take(void* target, std::size_t size)
  {
    if (size > bytes_.size() - place_) throw std::runtime_error("it is cut off");
    if (size > 0) std::memcpy(target, bytes_.data() + place_, size);
    place_ += size;
  }

  const std::string& bytes_;
  std::size_t place_ = 0;
};

} // namespace

std::string packed(const MesherAnswer& answer)
{
  Writer writer;
  writer.add(magic);
  writer.add_list(answer.problem);
  writer.add_list(answer.left_open);
  writer.add_list(answer.mesh.nodes);
  writer.add<std::uint64_t>(answer.mesh.blocks.size());
  for (const ElementBlock& block : answer.mesh.blocks)
  {
    writer.add(block.dimension);
    writer.add(block.type);
    writer.add_list(block.type_name);
    writer.add(block.nodes_per_element);
    writer.add_list(block.nodes);
    writer.add<std::uint64_t>(block.groups.size());
    for (const std::string& group : block.groups) writer.add_list(group);
  }
  writer.add(magic);
  return std::move(writer.bytes);
}

MesherAnswer unpacked(const std::string& bytes)
{
  Reader reader(bytes);
  MesherAnswer answer;
  if (reader.next<std::uint64_t>() != magic) throw std::runtime_error("it is no mesh");
  answer.problem = reader.next_list<std::string>();
  answer.left_open = reader.next_list<std::string>();
  answer.mesh.nodes = reader.next_list<std::vector<Vec3>>();
  const auto blocks = reader.next<std::uint64_t>();
  for (std::uint64_t b = 0; b < blocks; ++b)
  {
    ElementBlock block;
    block.dimension = reader.next<int>();
    block.type = reader.next<int>();
    block.type_name = reader.next_list<std::string>();
    block.nodes_per_element = reader.next<int>();
    block.nodes = reader.next_list<std::vector<int>>();
    const auto groups = reader.next<std::uint64_t>();
    for (std::uint64_t g = 0; g < groups; ++g) block.groups.push_back(reader.next_list<std::string>());
    answer.mesh.blocks.push_back(std::move(block));
  }
  if (reader.next<std::uint64_t>() != magic) throw std::runtime_error("it is cut off");
  return answer;
}

} // namespace squeal
