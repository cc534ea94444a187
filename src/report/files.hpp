#pragma once
/// The HDF5 files of a run, each written whole or not at all: what their data sets hold, and who writes them.
#include "squeal/report/report.hpp"

#include <array>
#include <filesystem>
#include <hdf5.h>
#include <span>
#include <string>
#include <vector>

namespace squeal
{

/// The version of the keys of report.json and of the data sets of the HDF5 files. Readers refuse a later one.
inline constexpr int format_version = 1;

/// A data set of a file. <number> and the like in its name stand for any text.
struct DataSet
{
  const char* name;
  const char* unit;
  const char* meaning;
};

/// An HDF5 file written by one rank. Data sets carry unit and meaning as attributes, the file its format_version and
/// the identity of its run. It is made in memory: on a full disk HDF5 itself would fail again when MPI ends.
class Hdf5File
{
public:
  Hdf5File(std::filesystem::path place, const std::string& run, std::span<const DataSet> sets);
  ~Hdf5File();
  Hdf5File(const Hdf5File&) = delete;
  Hdf5File& operator=(const Hdf5File&) = delete;

  /// Writes one of the file's data sets, a row an entry. Groups of its name, "cycle/energy", are made as needed.
  template <class Value> void write(const std::string& name, const std::vector<Value>& data)
  {
    write_data(name, {data.size()}, type_of<Value>(), data.data());
  }
  /// Writes one with rows of this many entries.
  template <class Value> void write(const std::string& name, const std::vector<Value>& data, std::size_t columns)
  {
    write_data(name, {data.size() / columns, columns}, type_of<Value>(), data.data());
  }
  void keep(); // writes the file in its place

private:
  template <class Value> static hid_t type_of()
  {
    if constexpr (std::is_same_v<Value, double>) return H5T_NATIVE_DOUBLE;
    return std::is_same_v<Value, int> ? H5T_NATIVE_INT : H5T_NATIVE_UCHAR;
  }
  const DataSet& set_of(const std::string& name) const;
  void write_data(const std::string& name, const std::vector<hsize_t>& shape, hid_t type, const void* data);

  std::filesystem::path place_;
  std::span<const DataSet> sets_;
  hid_t id_ = -1;
};

/// Data sets of history.h5.
inline constexpr std::array history_sets = {
    DataSet{"<run>/time", "s", "ends of steps of `transient`, `cycle` or `settled`; powers are means over a step"},
    DataSet{"<run>/energy", "J", "mechanical energy"},
    DataSet{"<run>/fluctuating_energy", "J", "energy of the motion about equilibrium"},
    DataSet{"<run>/damping_power", "W", "power that damping takes"},
    DataSet{"<run>/contact_power", "W", "power of the contact forces on the structure"},
    DataSet{"<run>/load_power", "W", "power of the load"},
    DataSet{"<run>/drive_power", "W", "power of the rotors' drive; less `contact_power` it is heat"},
    DataSet{"<run>/normal_force", "N", "sum of the normal reactions"},
    DataSet{"<run>/open", "pairs", "number of open pairs"},
    DataSet{"<run>/stick", "pairs", "number of sticking pairs"},
    DataSet{"<run>/slip", "pairs", "number of slipping pairs"},
    DataSet{"<run>/probes/<probe>", "m", "displacement of each probe"},
    DataSet{"cycle/status", "0 open, 1 stick, 2 slip", "status of each pair: steps in rows, pairs in columns"},
    DataSet{"settled/shapes/time", "s", "times of samples, at least 96 000 a second where the steps allow"},
    DataSet{"settled/shapes/coordinate", "m/s kg^1/2",
            "samples in rows: the velocity's factors of shapes of `fields.h5`"},
    DataSet{"settled/spectrum/frequency", "Hz", "of the probe that swings most, under a Hann window"},
    DataSet{"settled/spectrum/amplitude", "m, or N without probes", "amplitude there"},
    DataSet{"response/frequency", "Hz", "frequencies"},
    DataSet{"response/receptance/<excitation>/<probe>", "m/N", "real and imaginary part of displacement over force"},
};

/// Data sets of fields.h5.
inline constexpr std::array field_sets = {
    DataSet{"mesh/nodes", "m", "positions; nodal vectors have columns x, y and z"},
    DataSet{"mesh/topology", "XDMF mixed topology", "elements, each as XDMF's code and its nodes in VTK's order"},
    DataSet{"mesh/part", "index of the scene's part; -1: a point", "part of each element"},
    DataSet{"equilibrium/displacement", "m", "displacement at equilibrium"},
    DataSet{"equilibrium/normal_reaction", "N", "normal reaction of each node's pair; other nodes share it by weights"},
    DataSet{"equilibrium/friction_reaction", "N", "friction, likewise"},
    DataSet{"equilibrium/pressure", "Pa", "normal reaction over area; on the other side the mean of pairs"},
    DataSet{"pairs/node", "index in mesh/nodes, of the slave side", "node of each contact pair"},
    DataSet{"pairs/contact", "index of the scene's contact", "contact of each pair"},
    DataSet{"pairs/position", "m", "where the pair's reactions act"},
    DataSet{"pairs/normal", "-", "its normal, out of the rotor"},
    DataSet{"pairs/tangent_1", "-", "its first tangent"},
    DataSet{"pairs/tangent_2", "-", "its second tangent; zero with plane friction"},
    DataSet{"pairs/area", "m2", "its area; 0 for points"},
    DataSet{"pairs/gap", "m", "its initial gap"},
    DataSet{"pairs/reaction", "N", "its reactions at equilibrium along normal and tangents"},
    DataSet{"pairs/pressure", "Pa", "its normal reaction over its area"},
    DataSet{"probes/node", "index in mesh/nodes", "node that each probe reads, in the scene's order"},
    DataSet{"modes/<number>/real", "m",
            "real part of each unstable mode, of all with `-modes_shapes all`, in the order of `modes.modes[]`; its "
            "largest "
            "entry is 1. Where none is unstable the one that a given `cycle.start` has most of comes first"},
    DataSet{"modes/<number>/imaginary", "m", "its imaginary part"},
    DataSet{"modes/<number>/left_real", "1/(N s)",
            "real part of its left vector psi, with `[sensitivity]`; psi'Q'(lambda) phi = 1, Q of section 11"},
    DataSet{"modes/<number>/left_imaginary", "1/(N s)", "its imaginary part"},
    DataSet{"modes/<number>/pair_power", "1/s", "power of each pair over the mode's mean energy, with `[sensitivity]`"},
    DataSet{"settled/shape_<number>", "kg^-1/2", "shapes of a settled motion, the strongest first"},
    DataSet{"cycle/displacement_<sample>", "m", "displacement at times spread evenly over the period of the cycle"},
};

/// Rows of the page: name, unit and meaning of each data set.
std::string page_rows(std::span<const DataSet> sets);

/// On rank 0 alone. Error: the file cannot be written.
void write_history(const Report& report, const Scene& scene, const std::filesystem::path& file);

/// Writes fields.h5 and fields.xdmf. Collective. A matrix scene has no nodes and leaves no such files.
void write_fields(const Report& report, const Scene& scene, const Model& nodes, const std::filesystem::path& output,
                  MPI_Comm comm);

} // namespace squeal
