// Handlers of XLA's foreign functions: `ethogram_beams3d_f32` and `ethogram_beams3d_f64`.
//
// Attributes: floor; robots_first, whether axes of robots come before those that are given here and
// not, as they are written, after them; padded, whether only bonds and pairs that arguments 20 and 21 list are used; and
// bodies, whether every array has bodies, each with a material of its own, as its first axis.
// There are any number of axes of robots where `lane` is written.  All is of one type of numbers where nothing else is said.  Arguments:
//   0-11   the state: position [3, voxel, lane], orientation [4, voxel, lane], momentum, angular
//          momentum and force [3, voxel, lane], edge [voxel, lane], strain [bond, lane], small
//          [bond, lane] (pred), deformation [9, bond, lane], steps [] or [lane] (s32), diverged
//          [lane] (pred), clearance [lane]
//   12-13  edge [step, voxel, lane], gravity [step, 3] or [step, 3, lane]
//   14     constants [19], in the order of `Constants`
//   15-17  first and second voxel and axis of bonds [bond] (s32)
//   18-19  left and right voxel of pairs [pair] (s32)
//   20-21  bonds of first voxels, pairs of left voxels [slot, voxel] (s32)
// Results: the state, each array in the place of the argument that it was.

#include <stdlib.h>

#include "beams3d.h"
#include "ffi.h"

namespace ethogram {
namespace beams3d {
namespace {

constexpr int64_t ALIGNMENT = 64;

constexpr int64_t aligned(int64_t bytes) { return (bytes + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT; }

void check_voxels(Call& call, const char* name, const int32_t* voxel, int64_t items,
                  int64_t voxels) {
  for (int64_t i = 0; i < items; i++)
    if (voxel[i] < 0 || voxel[i] >= voxels)
      return call.refuse("argument %s: there is no voxel %d", name, (int)voxel[i]);
}

// Which items some voxel has.
void mark_used(const int32_t* listed, int64_t places, uint8_t* used, int64_t items) {
  memset(used, 0, items);
  for (int64_t i = 0; i < places; i++)
    if (listed[i] >= 0 && listed[i] < items) used[listed[i]] = 1;
}

// Sizes of the arrays; below 0 before the first array that has them.
struct Sizes {
  int64_t voxels = -1, bonds = -1, pairs = -1, lanes = -1, steps = -1;
  int64_t count_lanes = -1, gravity_lanes = -1, bond_slots = -1, pair_slots = -1;
};

constexpr int64_t SHARED = 1;  // lanes of what is the same for all robots
constexpr int64_t VECTOR = 3, QUATERNION = 4, DEFORMATION = 9;

template <class Number, class Flag, class Count, class Numbers, class Flags, class Counts>
State<Number, Flag, Count> take_state(Numbers numbers, Flags flags, Counts counts, Sizes& of) {
  State<Number, Flag, Count> state;
  state.position = numbers("state.position", of.lanes, VECTOR, of.voxels);
  state.orientation = numbers("state.orientation", of.lanes, QUATERNION, of.voxels);
  state.momentum = numbers("state.momentum", of.lanes, VECTOR, of.voxels);
  state.angular_momentum = numbers("state.angular_momentum", of.lanes, VECTOR, of.voxels);
  state.force = numbers("state.force", of.lanes, VECTOR, of.voxels);
  state.edge = numbers("state.edge", of.lanes, of.voxels);
  state.strain = numbers("state.strain", of.lanes, of.bonds);
  state.small = flags("state.memory.small", of.lanes, of.bonds);
  state.deformation = numbers("state.memory.deformation", of.lanes, DEFORMATION, of.bonds);
  state.steps = counts("state.steps", of.count_lanes);
  state.diverged = flags("state.diverged", of.lanes);
  state.clearance = numbers("state.clearance", of.lanes);
  return state;
}

template <class Number, class Flag, class Count>
State<Number, Flag, Count> of_body(const State<Number, Flag, Count>& all, int64_t body, const Sizes& of) {
  int64_t voxels = body * of.voxels * of.lanes, bonds = body * of.bonds * of.lanes;
  return {all.position + VECTOR * voxels,
          all.orientation + QUATERNION * voxels,
          all.momentum + VECTOR * voxels,
          all.angular_momentum + VECTOR * voxels,
          all.force + VECTOR * voxels,
          all.edge + voxels,
          all.strain + bonds,
          all.small + bonds,
          all.deformation + DEFORMATION * bonds,
          all.steps + body * of.count_lanes,
          all.diverged + body * of.lanes,
          all.clearance + body * of.lanes};
}

template <class Number>
Commands<Number> take_commands(Call& call, Sizes& of) {
  Commands<Number> commands;
  commands.edge = call.argument<Number>("edge", of.lanes, of.steps, of.voxels);
  commands.gravity = call.argument<Number>("gravity", of.gravity_lanes, of.steps, VECTOR);
  commands.steps = of.steps;
  commands.gravity_is_shared = of.gravity_lanes == SHARED;
  commands.count_is_shared = of.count_lanes == SHARED;
  if (of.steps == 0) call.refuse("argument edge: there are no steps");
  if (of.count_lanes != SHARED && of.count_lanes != of.lanes)
    call.refuse("argument state.steps: it is for %lld robots; it should be for 1 or %lld",
                (long long)of.count_lanes, (long long)of.lanes);
  if (of.gravity_lanes != SHARED && of.gravity_lanes != of.lanes)
    call.refuse("argument gravity: it is for %lld robots; it should be for 1 or %lld",
                (long long)of.gravity_lanes, (long long)of.lanes);
  return commands;
}

template <class Number>
Commands<Number> of_body(const Commands<Number>& all, int64_t body, const Sizes& of) {
  Commands<Number> commands = all;
  commands.edge += body * of.steps * of.voxels * of.lanes;
  commands.gravity += body * of.steps * VECTOR * of.gravity_lanes;
  return commands;
}

// Lattices, with what lists the bonds and pairs that are used.
struct Lattices {
  Lattice all;
  const int32_t *bond_items, *pair_items;
};

Lattices take_lattices(Call& call, Sizes& of) {
  Lattices lattices;
  Lattice& all = lattices.all;
  all.first = call.argument<int32_t>("lattice.first.voxel", SHARED, of.bonds);
  all.second = call.argument<int32_t>("lattice.second.voxel", SHARED, of.bonds);
  all.axis = call.argument<int32_t>("lattice.axis", SHARED, of.bonds);
  all.left = call.argument<int32_t>("lattice.left.voxel", SHARED, of.pairs);
  all.right = call.argument<int32_t>("lattice.right.voxel", SHARED, of.pairs);
  lattices.bond_items =
      call.argument<int32_t>("lattice.first.items", SHARED, of.bond_slots, of.voxels);
  lattices.pair_items =
      call.argument<int32_t>("lattice.left.items", SHARED, of.pair_slots, of.voxels);
  all.voxels = of.voxels, all.bonds = of.bonds, all.pairs = of.pairs;
  all.bond_used = all.pair_used = nullptr;
  if (call.failed()) return lattices;
  check_voxels(call, "lattice.first.voxel", all.first, call.bodies() * of.bonds, of.voxels);
  check_voxels(call, "lattice.second.voxel", all.second, call.bodies() * of.bonds, of.voxels);
  check_voxels(call, "lattice.left.voxel", all.left, call.bodies() * of.pairs, of.voxels);
  check_voxels(call, "lattice.right.voxel", all.right, call.bodies() * of.pairs, of.voxels);
  return lattices;
}

// The lattice of one body; `used` is room for a truth value for each bond and pair, or null.
Lattice of_body(const Lattices& lattices, int64_t body, const Sizes& of, uint8_t* used) {
  Lattice lattice = lattices.all;
  lattice.first += body * of.bonds, lattice.second += body * of.bonds;
  lattice.axis += body * of.bonds;
  lattice.left += body * of.pairs, lattice.right += body * of.pairs;
  if (!used) return lattice;
  int64_t bond_places = of.bond_slots * of.voxels, pair_places = of.pair_slots * of.voxels;
  mark_used(lattices.bond_items + body * bond_places, bond_places, used, of.bonds);
  mark_used(lattices.pair_items + body * pair_places, pair_places, used + of.bonds, of.pairs);
  lattice.bond_used = used, lattice.pair_used = used + of.bonds;
  return lattice;
}

template <class Number>
XLA_FFI_Error* handle(XLA_FFI_CallFrame* frame) {
  if (Call::asked_for_metadata(frame)) return nullptr;
  Call call(frame);
  Sizes of;
  auto before = take_state<const Number, const uint8_t, const int32_t>(
      [&](auto&&... which) { return call.argument<Number>(which...); },
      [&](auto&&... which) { return call.argument<uint8_t>(which...); },
      [&](auto&&... which) { return call.argument<int32_t>(which...); }, of);
  Commands<Number> commands = take_commands<Number>(call, of);
  const int64_t constants = sizeof(Constants<Number>) / sizeof(Number);
  const Number* numbers = call.argument<Number>("constants", SHARED, constants);
  Lattices lattices = take_lattices(call, of);
  auto after = take_state<Number, uint8_t, int32_t>(
      [&](auto&&... which) { return call.result<Number>(which...); },
      [&](auto&&... which) { return call.result<uint8_t>(which...); },
      [&](auto&&... which) { return call.result<int32_t>(which...); }, of);
  bool has_floor = call.flag("floor"), is_padded = call.flag("padded");
  if (XLA_FFI_Error* error = call.error()) return error;

  int64_t records = aligned(Simulation<Number>::memory(lattices.all));
  int64_t tile = call.robots_first() ? aligned(Tile<Number>::memory(lattices.all, of.steps)) : 0;
  int64_t bytes = records + tile + (is_padded ? of.bonds + of.pairs : 0) + ALIGNMENT;
  char* memory = static_cast<char*>(malloc(bytes));
  if (!memory) {
    call.refuse("there is no memory for a block of robots: %lld bytes", (long long)bytes);
    return call.error(XLA_FFI_Error_Code_RESOURCE_EXHAUSTED);
  }
  char* start = memory + (aligned((intptr_t)memory) - (intptr_t)memory);
  uint8_t* used = is_padded ? reinterpret_cast<uint8_t*>(start + records + tile) : nullptr;
  for (int64_t body = 0; body < call.bodies(); body++) {
    Constants<Number> material;
    memcpy(&material, numbers + body * constants, sizeof material);
    Simulation<Number> simulation(of_body(lattices, body, of, used), material, has_floor, start);
    auto from = of_body(before, body, of);
    auto to = of_body(after, body, of);
    auto commanded = of_body(commands, body, of);
    for (int64_t lane = 0; lane < of.lanes; lane += LANES<Number>) {
      int64_t left = of.lanes - lane;
      Block block = {lane, left < LANES<Number> ? left : LANES<Number>};
      if (call.robots_first())
        Tile<Number>(lattices.all, of.steps, start + records)
            .run(simulation, from, commanded, to, block);
      else
        simulation.run(from, commanded, to, of.lanes, block);
    }
  }
  for (int64_t count = 0; count < call.bodies() * of.count_lanes; count++)
    after.steps[count] = before.steps[count] + (int32_t)of.steps;
  free(memory);
  return nullptr;
}

}  // namespace
}  // namespace beams3d
}  // namespace ethogram

#define ETHOGRAM_EXPORT extern "C" __attribute__((visibility("default")))

ETHOGRAM_EXPORT XLA_FFI_Error* ethogram_beams3d_f32(XLA_FFI_CallFrame* frame) {
  return ethogram::beams3d::handle<float>(frame);
}

ETHOGRAM_EXPORT XLA_FFI_Error* ethogram_beams3d_f64(XLA_FFI_CallFrame* frame) {
  return ethogram::beams3d::handle<double>(frame);
}
