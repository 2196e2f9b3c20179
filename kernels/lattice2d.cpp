// Handlers of XLA's foreign functions: `ethogram_lattice2d_f32` and `_f64`, which move robots, and
// `ethogram_lattice2d_avalanches_f32` and `_f64`.
//
// Attributes: outline, whether there are but springs of the outline and the diagonals; sweeps of
// the solver (s64); and bodies, whether every array has bodies, each with a material and a terrain
// of its own, as its first axis.  Of those that move: robots_first, whether axes of robots come before
// those that are given here and not, as they are written, after them.  Of avalanches: most_steps
// (s64).
// There are any number of axes of robots where `lane` is written.  All is of one type of numbers
// where nothing else is said.  Arguments of those that move robots:
//   0-5    the state: moved, heading [2, colour, body, lane], velocity, change [3, colour, body,
//          lane], rope [4, voxel, lane], contact [point, 2, colour, body, lane] of 8 points, or of
//          none if there is no terrain
//   6-7    control [step, voxel, lane], gravity []
//   8-9    ground, ceiling [point, 2]; of no points if there is none
//   10     constants [11], in the order of `Constants`
//   11-18  the lattice: cell [voxel, 2] (s32), used [voxel] (pred), body [colour, voxel] (s32),
//          voxel [colour, body, member] (s32), vertex, centre [2, colour, body], squares, inertia
//          [colour, body]
// Results: the state, each array in the place of the argument that it was.
//
// Arguments of avalanches: threshold [], constants, the lattice.  Results: sizes, durations [voxel]
// (s32), 0 of padding.

#include <stdlib.h>

#include "ffi.h"
#include "lattice2d_avalanches.h"

namespace ethogram {
namespace lattice2d {
namespace {

constexpr int64_t SHARED = 1;  // lanes of what is the same for all robots
constexpr int64_t XY = 2, XYW = 3;

// Sizes of the arrays; below 0 before the first array that has them.
struct Sizes {
  int64_t voxels = -1, bodies = -1, points = -1, lanes = -1, steps = -1;
  int64_t ground_points = -1, ceiling_points = -1;
};

template <class Number, class Numbers>
State<Number> take_state(Numbers numbers, Sizes& of) {
  State<Number> state;
  const int64_t colours = COLOURS, sides = SIDES;
  state.field[MOVED] = numbers("state.moved", of.lanes, XY, colours, of.bodies);
  state.field[HEADING] = numbers("state.heading", of.lanes, XY, colours, of.bodies);
  state.field[VELOCITY] = numbers("state.velocity", of.lanes, XYW, colours, of.bodies);
  state.field[CHANGE] = numbers("state.change", of.lanes, XYW, colours, of.bodies);
  state.field[ROPE] = numbers("state.rope", of.lanes, sides, of.voxels);
  state.field[CONTACT] = numbers("state.contact", of.lanes, of.points, XY, colours, of.bodies);
  return state;
}

template <class Number>
State<Number> of_body(const State<Number>& all, int64_t body, const Sizes& of) {
  State<Number> state = all;
  Rows rows(of.voxels, of.bodies, of.points);
  for (int field = 0; field < FIELDS; field++)
    state.field[field] += body * rows.field[field] * of.lanes;
  return state;
}

template <class Number>
Commands<Number> take_commands(Call& call, Sizes& of) {
  Commands<Number> commands;
  commands.control = call.argument<Number>("control", of.lanes, of.steps, of.voxels);
  commands.gravity = call.argument<Number>("gravity", SHARED);
  commands.steps = of.steps;
  return commands;
}

template <class Number>
Commands<Number> of_body(const Commands<Number>& all, int64_t body, const Sizes& of) {
  Commands<Number> commands = all;
  commands.control += body * of.steps * of.voxels * of.lanes;
  commands.gravity += body;
  return commands;
}

template <class Number>
Terrain<Number> take_terrain(Call& call, Sizes& of) {
  Terrain<Number> terrain;
  terrain.ground = call.argument<Number>("ground", SHARED, of.ground_points, XY);
  terrain.ceiling = call.argument<Number>("ceiling", SHARED, of.ceiling_points, XY);
  terrain.ground_points = of.ground_points, terrain.ceiling_points = of.ceiling_points;
  if (of.ground_points == 1) call.refuse("argument ground: it has one point");
  if (of.ceiling_points == 1) call.refuse("argument ceiling: it has one point");
  if (of.ground_points == 0 && of.ceiling_points > 0)
    call.refuse("argument ceiling: there is none without a ground");
  if (of.points != POINTS && (of.points != 0 || of.ground_points > 0))
    call.refuse("argument state.contact: it has %lld points; it should have %d",
                (long long)of.points, POINTS);
  return terrain;
}

template <class Number>
Terrain<Number> of_body(const Terrain<Number>& all, int64_t body, const Sizes& of) {
  Terrain<Number> terrain = all;
  terrain.ground += body * of.ground_points * XY;
  terrain.ceiling += body * of.ceiling_points * XY;
  return terrain;
}

template <class Number>
Constants<Number> of_body(const Number* constants, int64_t body) {
  Constants<Number> material;
  memcpy(&material, constants + body * static_cast<int64_t>(sizeof material / sizeof(Number)),
         sizeof material);
  return material;
}

template <class Number>
Lattice<Number> of_body(const Lattice<Number>& all, int64_t body) {
  const int64_t numbers = body * COLOURS * all.bodies, voxels = body * all.voxels;
  return {all.voxels,
          all.bodies,
          all.cell + XY * voxels,
          all.used + voxels,
          all.body + COLOURS * voxels,
          all.voxel + MEMBERS * numbers,
          all.vertex + XY * numbers,
          all.centre + XY * numbers,
          all.squares + numbers,
          all.inertia + numbers};
}

// Whether the rigid bodies of a lattice have the voxels that say that they are part of them.
template <class Number>
void check(Call& call, const Lattice<Number>& lattice) {
  for (int64_t i = 0; i < COLOURS * lattice.bodies * MEMBERS; i++)
    if (lattice.voxel[i] < 0 || lattice.voxel[i] > lattice.voxels)
      return call.refuse("argument lattice.voxel: there is no voxel %d", (int)lattice.voxel[i]);
  for (int64_t i = 0; i < COLOURS * lattice.voxels; i++) {
    const int64_t colour = i / lattice.voxels, voxel = i % lattice.voxels;
    const int32_t body = lattice.body[i];
    if (body < 0 || body >= lattice.bodies)
      return call.refuse("argument lattice.body: there is no rigid body %d", (int)body);
    const int32_t* members = lattice.voxel + (colour * lattice.bodies + body) * MEMBERS;
    bool is_member = !lattice.used[voxel];
    for (int member = 0; member < MEMBERS && members[member] < lattice.voxels; member++)
      is_member |= members[member] == voxel;
    if (!is_member)
      return call.refuse("argument lattice.body: rigid body %d has no voxel %d", (int)body,
                         (int)voxel);
  }
}

template <class Number>
Lattice<Number> take_lattice(Call& call, Sizes& of) {
  Lattice<Number> all;
  const int64_t colours = COLOURS, members = MEMBERS;
  all.cell = call.argument<int32_t>("lattice.cell", SHARED, of.voxels, XY);
  all.used = call.argument<uint8_t>("lattice.used", SHARED, of.voxels);
  all.body = call.argument<int32_t>("lattice.body", SHARED, colours, of.voxels);
  all.voxel = call.argument<int32_t>("lattice.voxel", SHARED, colours, of.bodies, members);
  all.vertex = call.argument<Number>("lattice.vertex", SHARED, XY, colours, of.bodies);
  all.centre = call.argument<Number>("lattice.centre", SHARED, XY, colours, of.bodies);
  all.squares = call.argument<Number>("lattice.squares", SHARED, colours, of.bodies);
  all.inertia = call.argument<Number>("lattice.inertia", SHARED, colours, of.bodies);
  all.voxels = of.voxels, all.bodies = of.bodies;
  for (int64_t body = 0; !call.failed() && body < call.bodies(); body++)
    check(call, of_body(all, body));
  return all;
}

template <class Number>
const Number* take_constants(Call& call) {
  const int64_t count = sizeof(Constants<Number>) / sizeof(Number);
  return call.argument<Number>("constants", SHARED, count);
}

// A block of memory for as long as a call lasts; null, and the call refused, if there is none.
class Memory {
 public:
  Memory(Call& call, int64_t bytes) : block_(malloc(bytes)) {
    if (!block_)
      call.refuse("there is no memory for a block of robots: %lld bytes", (long long)bytes);
  }
  ~Memory() { free(block_); }
  Memory(const Memory&) = delete;
  Memory& operator=(const Memory&) = delete;

  void* block() const { return block_; }

 private:
  void* const block_;
};

// A block of arrays of which robots are the first axis, turned round: the simulation's robots last.
template <class Number>
class Tile {
  static constexpr int64_t WIDTH = LANES<Number>;

 public:
  Tile(const Sizes& of, Arena& arena)
      : of_(of), rows_(of.voxels, of.bodies, of.points),
        control_(arena.take<Number>(WIDTH * of.steps * of.voxels)) {
    for (int field = 0; field < FIELDS; field++)
      state_.field[field] = arena.take<Number>(WIDTH * rows_.field[field]);
  }

  void run(Simulation<Number>& simulation, const State<const Number>& before,
           const Commands<Number>& commands, const State<Number>& after, Block block) {
    State<const Number> state;
    for (int field = 0; field < FIELDS; field++) {
      lanes_last(before.field[field], rows_.field[field], block, state_.field[field]);
      state.field[field] = state_.field[field];
    }
    Commands<Number> turned = commands;
    lanes_last(commands.control, commands.steps * of_.voxels, block, control_);
    turned.control = control_;
    simulation.run(state, turned, state_, of_.points, WIDTH, {0, WIDTH});
    for (int field = 0; field < FIELDS; field++)
      lanes_first(state_.field[field], rows_.field[field], block, after.field[field]);
  }

 private:
  const Sizes of_;
  const Rows rows_;
  State<Number> state_;
  Number* const control_;
};

template <class Number>
XLA_FFI_Error* move(XLA_FFI_CallFrame* frame) {
  if (Call::asked_for_metadata(frame)) return nullptr;
  Call call(frame);
  Sizes of;
  auto before = take_state<const Number>(
      [&](auto&&... which) { return call.argument<Number>(which...); }, of);
  Commands<Number> commands = take_commands<Number>(call, of);
  Terrain<Number> terrain = take_terrain<Number>(call, of);
  const Number* constants = take_constants<Number>(call);
  Lattice<Number> lattices = take_lattice<Number>(call, of);
  auto after =
      take_state<Number>([&](auto&&... which) { return call.result<Number>(which...); }, of);
  bool all_springs = !call.flag("outline");
  int64_t sweeps = call.integer("sweeps");
  if (XLA_FFI_Error* error = call.error()) return error;

  Arena measured(nullptr);
  Simulation<Number>(lattices, {}, terrain, all_springs, sweeps, measured, true);
  Tile<Number>(of, measured);
  Memory memory(call, measured.bytes());
  if (call.failed()) return call.error(XLA_FFI_Error_Code_RESOURCE_EXHAUSTED);
  for (int64_t body = 0; body < call.bodies(); body++) {
    Arena arena(memory.block());
    Simulation<Number> simulation(of_body(lattices, body), of_body(constants, body),
                                  of_body(terrain, body, of), all_springs, sweeps, arena);
    Tile<Number> tile(of, arena);
    State<const Number> from = of_body(before, body, of);
    State<Number> to = of_body(after, body, of);
    Commands<Number> commanded = of_body(commands, body, of);
    for (int64_t lane = 0; lane < of.lanes; lane += LANES<Number>) {
      int64_t left = of.lanes - lane;
      Block block = {lane, left < LANES<Number> ? left : LANES<Number>};
      if (call.robots_first())
        tile.run(simulation, from, commanded, to, block);
      else
        simulation.run(from, commanded, to, of.points, of.lanes, block);
    }
  }
  return nullptr;
}

template <class Number>
XLA_FFI_Error* find_avalanches(XLA_FFI_CallFrame* frame) {
  if (Call::asked_for_metadata(frame)) return nullptr;
  Call call(frame);
  Sizes of;
  const Number* thresholds = call.argument<Number>("threshold", SHARED);
  const Number* constants = take_constants<Number>(call);
  Lattice<Number> lattices = take_lattice<Number>(call, of);
  int32_t* sizes = call.result<int32_t>("sizes", SHARED, of.voxels);
  int32_t* durations = call.result<int32_t>("durations", SHARED, of.voxels);
  bool all_springs = !call.flag("outline");
  int64_t sweeps = call.integer("sweeps"), most_steps = call.integer("most_steps");
  if (XLA_FFI_Error* error = call.error()) return error;

  const Terrain<Number> none = {};
  Arena measured(nullptr);
  Simulation<Number> unused(lattices, {}, none, all_springs, sweeps, measured, true);
  Avalanches<Number>(unused, of.voxels, measured);
  Memory memory(call, measured.bytes());
  if (call.failed()) return call.error(XLA_FFI_Error_Code_RESOURCE_EXHAUSTED);
  memset(sizes, 0, call.bodies() * of.voxels * sizeof *sizes);
  memset(durations, 0, call.bodies() * of.voxels * sizeof *durations);
  for (int64_t body = 0; body < call.bodies(); body++) {
    Arena arena(memory.block());
    Simulation<Number> simulation(of_body(lattices, body), of_body(constants, body), none,
                                  all_springs, sweeps, arena);
    Avalanches<Number>(simulation, of.voxels, arena)
        .run(thresholds[body], most_steps, sizes + body * of.voxels, durations + body * of.voxels);
  }
  return nullptr;
}

}  // namespace
}  // namespace lattice2d
}  // namespace ethogram

#define ETHOGRAM_EXPORT extern "C" __attribute__((visibility("default")))

ETHOGRAM_EXPORT XLA_FFI_Error* ethogram_lattice2d_f32(XLA_FFI_CallFrame* frame) {
  return ethogram::lattice2d::move<float>(frame);
}

ETHOGRAM_EXPORT XLA_FFI_Error* ethogram_lattice2d_f64(XLA_FFI_CallFrame* frame) {
  return ethogram::lattice2d::move<double>(frame);
}

ETHOGRAM_EXPORT XLA_FFI_Error* ethogram_lattice2d_avalanches_f32(XLA_FFI_CallFrame* frame) {
  return ethogram::lattice2d::find_avalanches<float>(frame);
}

ETHOGRAM_EXPORT XLA_FFI_Error* ethogram_lattice2d_avalanches_f64(XLA_FFI_CallFrame* frame) {
  return ethogram::lattice2d::find_avalanches<double>(frame);
}
