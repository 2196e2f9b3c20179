// Handlers of XLA's foreign functions: `ethogram_beams3d_f32` and `ethogram_beams3d_f64`.
//
// Every array has bodies as its first axis, each with a material of its own, and robots of that body
// as its last, `lane`; all are of one type of numbers where nothing else is said.  Arguments:
//   0-10   the state: position [body, 3, voxel, lane], orientation [body, 4, voxel, lane], momentum,
//          angular momentum and force [body, 3, voxel, lane], edge [body, voxel, lane], strain
//          [body, bond, lane], small [body, bond, lane] (pred), deformation [body, 9, bond, lane],
//          diverged [body, lane] (pred), clearance [body, lane]
//   11     first step [body, 1] or [body, lane] (pred)
//   12-13  edge [body, step, voxel, lane], gravity [body, step, 3, 1] or [body, step, 3, lane]
//   14     constants [body, 19], in the order of `Constants`
//   15-17  first and second voxel and axis of bonds [body, bond] (s32)
//   18-19  left and right voxel of pairs [body, pair] (s32)
//   20-21  bonds of first voxels, pairs of left voxels [body, slot, voxel] (s32)
// Attributes: floor, and whether lattices are padded: then only bonds and pairs that arguments 20
// and 21 list are used.  Results: the state, each array in the place of the argument that it was.

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
  int64_t bodies = -1, voxels = -1, bonds = -1, pairs = -1, lanes = -1, steps = -1;
  int64_t first_lanes = -1, gravity_lanes = -1, bond_slots = -1, pair_slots = -1;
};

constexpr int64_t ROWS_OF_VECTOR = 3, ROWS_OF_QUATERNION = 4, ROWS_OF_DEFORMATION = 9;

template <class Number, class Flag, class Numbers, class Flags>
State<Number, Flag> take_state(Numbers numbers, Flags flags, Sizes& of) {
  State<Number, Flag> state;
  state.position = numbers("state.position", of.bodies, ROWS_OF_VECTOR, of.voxels, of.lanes);
  state.orientation =
      numbers("state.orientation", of.bodies, ROWS_OF_QUATERNION, of.voxels, of.lanes);
  state.momentum = numbers("state.momentum", of.bodies, ROWS_OF_VECTOR, of.voxels, of.lanes);
  state.angular_momentum =
      numbers("state.angular_momentum", of.bodies, ROWS_OF_VECTOR, of.voxels, of.lanes);
  state.force = numbers("state.force", of.bodies, ROWS_OF_VECTOR, of.voxels, of.lanes);
  state.edge = numbers("state.edge", of.bodies, of.voxels, of.lanes);
  state.strain = numbers("state.strain", of.bodies, of.bonds, of.lanes);
  state.small = flags("state.memory.small", of.bodies, of.bonds, of.lanes);
  state.deformation =
      numbers("state.memory.deformation", of.bodies, ROWS_OF_DEFORMATION, of.bonds, of.lanes);
  state.diverged = flags("state.diverged", of.bodies, of.lanes);
  state.clearance = numbers("state.clearance", of.bodies, of.lanes);
  return state;
}

template <class Number, class Flag>
State<Number, Flag> of_body(const State<Number, Flag>& all, int64_t body, const Sizes& of) {
  int64_t voxels = body * of.voxels * of.lanes, bonds = body * of.bonds * of.lanes;
  return {all.position + ROWS_OF_VECTOR * voxels,
          all.orientation + ROWS_OF_QUATERNION * voxels,
          all.momentum + ROWS_OF_VECTOR * voxels,
          all.angular_momentum + ROWS_OF_VECTOR * voxels,
          all.force + ROWS_OF_VECTOR * voxels,
          all.edge + voxels,
          all.strain + bonds,
          all.small + bonds,
          all.deformation + ROWS_OF_DEFORMATION * bonds,
          all.diverged + body * of.lanes,
          all.clearance + body * of.lanes};
}

template <class Number>
Commands<Number> take_commands(Call& call, Sizes& of) {
  Commands<Number> commands;
  commands.first_step = call.argument<uint8_t>("first_step", of.bodies, of.first_lanes);
  commands.edge = call.argument<Number>("edge", of.bodies, of.steps, of.voxels, of.lanes);
  commands.gravity =
      call.argument<Number>("gravity", of.bodies, of.steps, ROWS_OF_VECTOR, of.gravity_lanes);
  commands.steps = of.steps;
  commands.first_step_is_shared = of.first_lanes == 1;
  commands.gravity_is_shared = of.gravity_lanes == 1;
  if (of.first_lanes != 1 && of.first_lanes != of.lanes)
    call.refuse("argument first_step: it is for %lld robots; it should be for 1 or %lld",
                (long long)of.first_lanes, (long long)of.lanes);
  if (of.gravity_lanes != 1 && of.gravity_lanes != of.lanes)
    call.refuse("argument gravity: it is for %lld robots; it should be for 1 or %lld",
                (long long)of.gravity_lanes, (long long)of.lanes);
  return commands;
}

template <class Number>
Commands<Number> of_body(const Commands<Number>& all, int64_t body, const Sizes& of) {
  Commands<Number> commands = all;
  commands.first_step += body * of.first_lanes;
  commands.edge += body * of.steps * of.voxels * of.lanes;
  commands.gravity += body * of.steps * ROWS_OF_VECTOR * of.gravity_lanes;
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
  all.first = call.argument<int32_t>("lattice.first.voxel", of.bodies, of.bonds);
  all.second = call.argument<int32_t>("lattice.second.voxel", of.bodies, of.bonds);
  all.axis = call.argument<int32_t>("lattice.axis", of.bodies, of.bonds);
  all.left = call.argument<int32_t>("lattice.left.voxel", of.bodies, of.pairs);
  all.right = call.argument<int32_t>("lattice.right.voxel", of.bodies, of.pairs);
  lattices.bond_items =
      call.argument<int32_t>("lattice.first.items", of.bodies, of.bond_slots, of.voxels);
  lattices.pair_items =
      call.argument<int32_t>("lattice.left.items", of.bodies, of.pair_slots, of.voxels);
  all.voxels = of.voxels, all.bonds = of.bonds, all.pairs = of.pairs;
  all.bond_used = all.pair_used = nullptr;
  if (call.failed()) return lattices;
  check_voxels(call, "lattice.first.voxel", all.first, of.bodies * of.bonds, of.voxels);
  check_voxels(call, "lattice.second.voxel", all.second, of.bodies * of.bonds, of.voxels);
  check_voxels(call, "lattice.left.voxel", all.left, of.bodies * of.pairs, of.voxels);
  check_voxels(call, "lattice.right.voxel", all.right, of.bodies * of.pairs, of.voxels);
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
  auto before = take_state<const Number, const uint8_t>(
      [&](auto&&... which) { return call.argument<Number>(which...); },
      [&](auto&&... which) { return call.argument<uint8_t>(which...); }, of);
  Commands<Number> commands = take_commands<Number>(call, of);
  int64_t constants = sizeof(Constants<Number>) / sizeof(Number);
  const Number* numbers = call.argument<Number>("constants", of.bodies, constants);
  Lattices lattices = take_lattices(call, of);
  auto after = take_state<Number, uint8_t>(
      [&](auto&&... which) { return call.result<Number>(which...); },
      [&](auto&&... which) { return call.result<uint8_t>(which...); }, of);
  bool has_floor = call.flag("floor"), is_padded = call.flag("padded");
  if (XLA_FFI_Error* error = call.error()) return error;

  int64_t records = aligned(Simulation<Number>::memory(lattices.all));
  int64_t flags = is_padded ? of.bonds + of.pairs : 0;
  char* memory = static_cast<char*>(malloc(records + flags + ALIGNMENT));
  if (!memory) {
    call.refuse("there is no memory for a block of robots: %lld bytes", (long long)records);
    return call.error(XLA_FFI_Error_Code_RESOURCE_EXHAUSTED);
  }
  char* start = memory + (aligned((intptr_t)memory) - (intptr_t)memory);
  uint8_t* used = is_padded ? reinterpret_cast<uint8_t*>(start + records) : nullptr;
  for (int64_t body = 0; body < of.bodies; body++) {
    Constants<Number> material;
    memcpy(&material, numbers + body * constants, sizeof material);
    Simulation<Number> simulation(of_body(lattices, body, of, used), material, has_floor, start);
    for (int64_t lane = 0; lane < of.lanes; lane += LANES<Number>) {
      int64_t left = of.lanes - lane;
      Block block = {lane, left < LANES<Number> ? left : LANES<Number>};
      simulation.run(of_body(before, body, of), of_body(commands, body, of),
                     of_body(after, body, of), of.lanes, block);
    }
  }
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
