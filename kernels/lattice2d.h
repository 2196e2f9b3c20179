// Soft bodies in the plane: steps of a block of robots that lie side by side.
//
// The model, and the names of its parts, are those of `ethogram.physics.lattice2d`, where each
// formula has its source; equations are written here only where they are turned into another form.
// A block is copied from the state's arrays into records of one vector per number, stepped there,
// in the processor's cache, and copied back.
//
// Differences in form, none in what is computed:
// - voxels are not mirrored, since their squares are named by place;
// - springs of two voxels between the same two rigid bodies share a block of the matrix;
// - a spring's direction is not made of length 1: squares of its length cancel (`add_spring`);
// - impulses of ropes and contacts are kept in the momentum of rigid bodies as they change;
// - ropes, contacts and corrections are done only where a lane needs them; a lane that does not has
//   the same bits;
// - rigid bodies and voxels that are padding stay as they are.

#pragma once

#include "lattice2d_plan.h"
#include "lattice2d_vectors.h"

namespace ethogram {
namespace lattice2d {

constexpr double SHORTEST = 1e-9;  // m: what keeps a direction finite
constexpr double SLOWEST = 1.0;    // m/s: what approaches more slowly does not bounce
constexpr double SLOP = 0.005;     // m, that may overlap
constexpr double CORRECTED = 0.2;  // share of the rest of an overlap that a pass removes
constexpr double FARTHEST = 0.2;   // m, that a pass moves something
constexpr int PASSES = 10;
constexpr double SERIES_END = 0.785;  // rad: sine and cosine of what turns more are the C library's

// The state's arrays, each [component, ..., lane], in the order of `motion.State`.
enum Field { MOVED, HEADING, VELOCITY, CHANGE, ROPE, CONTACT, FIELDS };

template <class Number>
struct State {
  Number* field[FIELDS];
};

// How many numbers a robot has of each.
struct Rows {
  int64_t field[FIELDS];

  Rows(int64_t voxels, int64_t bodies, int64_t points)
      : field{2 * COLOURS * bodies, 2 * COLOURS * bodies, 3 * COLOURS * bodies,
              3 * COLOURS * bodies, SIDES * voxels,       2 * points * COLOURS * bodies} {}
};

// What is commanded: control [step, voxel, lane], and gravity.
template <class Number>
struct Commands {
  int64_t steps;
  const Number *control, *gravity;
};

// Steps of the robots of one block, then of the next.
template <class Number>
class Simulation {
  typedef ethogram::Vector<Number> Lanes;
  typedef ethogram::Mask<Number> Mask;
  typedef lattice2d::Vector2<Lanes> Vector2;
  typedef lattice2d::Vector3<Lanes> Vector3;
  typedef lattice2d::Matrix<Lanes> Matrix;
  typedef typename Plan<Number>::Body Body;
  typedef typename Plan<Number>::Voxel Voxel;
  typedef typename Plan<Number>::Link Link;
  typedef typename Plan<Number>::Line Line;

  struct Place {
    Vector2 moved, heading;
  };

  // The equations of a rigid body: of its mass and springs, and what impulses but those give it.
  struct System {
    Matrix inverse;
    Vector3 momentum;
  };

  // What springs do to the first of two rigid bodies because the second one moves:
  // linear v + second w along, first v + turning w about; and to the second the same, exchanged.
  struct Block {
    Lanes xx, xy, yy, turning;
    Vector2 first, second;
  };

  struct Square {
    Vector2 lever, at;     // from the rigid body's centre; with what that is moved
    Vector2 upper, lower;  // from the square's centre to its own corners (1, 1) and (1, -1)

    ETHOGRAM_INLINE Vector2 corner(int x, int y) const {
      return x == y ? (x > 0 ? upper : -upper) : (x > 0 ? lower : -lower);
    }
  };

  // Sums over the springs between two squares, as `springs.Pair`, of which `turn` is `angular`.
  struct Pair {
    Lanes xx, xy, yy;
    Vector2 first, second;
    Lanes turn_11, turn_12, turn_22;
    Vector2 pull;
    Lanes pull_1, pull_2;
  };

  // How an impulse along a direction moves a rigid body.
  struct Push {
    Vector2 direction;
    Lanes turn;         // lever x direction
    Vector3 response;   // of the velocity, to 1 N s
    Lanes per_speed;    // the impulse that changes the velocity along it by 1 m/s

    ETHOGRAM_INLINE Lanes speed(Vector3 v) const {
      return fma(turn, v.w, dot(direction, {v.x, v.y}));
    }
    ETHOGRAM_INLINE Lanes softness() const {
      return fma(turn, response.w, dot(direction, {response.x, response.y}));
    }
    ETHOGRAM_INLINE void act(Lanes impulse, Vector3& velocity, Vector3& momentum) const {
      velocity = fma(impulse, response, velocity);
      momentum = fma(impulse, Vector3{direction.x, direction.y, turn}, momentum);
    }
  };

  struct Rope {
    int32_t voxel, first, second;  // rigid bodies
    int side;                      // by colour
    Mask taut;
    Push on_first, on_second;
    Lanes per_speed;
  };

  struct Contact {
    int32_t body, point;  // of all points
    Mask touching;
    Vector2 local;  // from the rigid body's centre, not rotated
    Push along, across;
    Lanes rebound, reach;
  };

  // A line of the terrain above or below a place.
  struct Surface {
    Vector2 normal;
    Lanes reach;
  };

 public:
  Simulation(const Lattice<Number>& lattice, const Constants<Number>& of,
             const Terrain<Number>& terrain, bool all_springs, int64_t sweeps, Arena& arena,
             bool measures = false)
      : plan_(lattice, of, terrain, arena, measures),
        of_(of),
        numbers_(COLOURS * lattice.bodies),
        array_voxels_(lattice.voxels),
        all_springs_(all_springs),
        has_terrain_(terrain.ground_points > 0),
        sweeps_(sweeps),
        place_(arena.take<Place>(numbers_)),
        velocity_(arena.take<Vector3>(numbers_)),
        free_(arena.take<Vector3>(numbers_)),
        change_(arena.take<Vector3>(numbers_)),
        system_(arena.take<System>(numbers_)),
        blocks_(arena.take<Block>(PAIRS * lattice.voxels)),
        control_(arena.take<Lanes>(lattice.voxels)),
        rope_impulse_(arena.take<Lanes>(SIDES * lattice.voxels)),
        rope_pushes_(arena.take<uint8_t>(SIDES * lattice.voxels)),
        ropes_(arena.take<Rope>(SIDES * lattice.voxels)),
        pushing_(arena.take<Lanes>(POINTS * numbers_)),
        sideways_(arena.take<Lanes>(POINTS * numbers_)),
        point_pushes_(arena.take<uint8_t>(POINTS * numbers_)),
        contacts_(arena.take<Contact>(POINTS * numbers_)) {}

  // All steps of a block, from one state's arrays to another's, which may be the same.
  void run(const State<const Number>& before, const Commands<Number>& commands,
           const State<Number>& after, int64_t points, int64_t lanes, ethogram::Block block) {
    read(before, points, lanes, block);
    gravity_ = all(*commands.gravity);
    for (int64_t now = 0; now < commands.steps; now++) {
      for (int64_t v = 0; v < plan_.voxels(); v++)
        control_[v] = load(
            commands.control + (now * array_voxels_ + plan_.voxel(v).number) * lanes, block);
      step();
    }
    copy_padding(before, after, points, lanes, block);
    write(after, points, lanes, block);
  }

  // In place of `run`, for those that command by themselves: bodies at rest in some lanes, without
  // gravity; then `control` and `step`.
  void rest(Mask lanes) {
    Lanes none = all(0), one = all(1);
    for (int64_t b = 0; b < plan_.bodies(); b++) {
      Place& at = place_[b];
      at.moved = choose(lanes, Vector2{none, none}, at.moved);
      at.heading = choose(lanes, Vector2{one, none}, at.heading);
      velocity_[b] = choose(lanes, Vector3{none, none, none}, velocity_[b]);
      change_[b] = choose(lanes, Vector3{none, none, none}, change_[b]);
    }
    for (int64_t rope = 0; rope < SIDES * plan_.voxels(); rope++) {
      rope_impulse_[rope] = lanes ? none : rope_impulse_[rope];
      rope_pushes_[rope] = true;  // to be looked at
    }
    gravity_ = none;
  }

  const Plan<Number>& plan() const { return plan_; }

  // Of a voxel by its number in the plan.
  Lanes& control(int64_t v) { return control_[v]; }

  void step() {
    fall();
    if (all_springs_)
      springs<true>();
    else
      springs<false>();
    for (int64_t b = 0; b < plan_.bodies(); b++) system_[b].inverse = inverse(system_[b].inverse);
    contact_count_ = 0;
    if (has_terrain_) touch();
    for (int64_t rope = 0; rope < rope_count_; rope++) prepare(ropes_[rope]);
    for (int64_t sweep = 0; sweep < sweeps_; sweep++) {
      colours();
      for (int64_t contact = 0; contact < contact_count_; contact++) resolve(contacts_[contact]);
      for (int64_t rope = 0; rope < rope_count_; rope++) tighten(ropes_[rope]);
    }
    move();
    correct();
  }

  // Area of a voxel between its four outermost corners, over that at rest.
  Lanes area_ratio(int64_t v) const {
    const Voxel& voxel = plan_.voxel(v);
    Square squares[PLACES];
    squares_of(voxel, squares);
    Vector2 corner[PLACES];
    for (int place = 0; place < PLACES; place++)
      corner[place] = squares[place].at + squares[place].corner(sign_x(place), sign_y(place));
    Vector2 rising = corner[3] - corner[0] + apart(voxel, 4);
    Vector2 falling = corner[2] - corner[1] + apart(voxel, 5);
    return cross(rising, falling) * all(1 / (2 * of_.resting * of_.resting));
  }

 private:
  static ETHOGRAM_INLINE Lanes all(Number value) { return broadcast(value); }
  static ETHOGRAM_INLINE Vector2 all(Number x, Number y) { return {broadcast(x), broadcast(y)}; }

  static ETHOGRAM_INLINE Vector2 choose(Mask mask, Vector2 a, Vector2 b) {
    return {mask ? a.x : b.x, mask ? a.y : b.y};
  }
  static ETHOGRAM_INLINE Vector3 choose(Mask mask, Vector3 a, Vector3 b) {
    return {mask ? a.x : b.x, mask ? a.y : b.y, mask ? a.w : b.w};
  }

  void read(const State<const Number>& state, int64_t points, int64_t lanes,
            ethogram::Block block) {
    auto at = [&](Field field, int64_t row) {
      return load(state.field[field] + row * lanes, block);
    };
    for (int64_t b = 0; b < plan_.bodies(); b++) {
      int64_t x = plan_.body(b).number, y = x + numbers_, w = y + numbers_;
      place_[b] = {{at(MOVED, x), at(MOVED, y)}, {at(HEADING, x), at(HEADING, y)}};
      velocity_[b] = {at(VELOCITY, x), at(VELOCITY, y), at(VELOCITY, w)};
      change_[b] = {at(CHANGE, x), at(CHANGE, y), at(CHANGE, w)};
      for (int64_t point = 0; point < points; point++) {
        Lanes pushing = at(CONTACT, 2 * point * numbers_ + x);
        Lanes sideways = at(CONTACT, (2 * point + 1) * numbers_ + x);
        int64_t place = POINTS * b + point;
        pushing_[place] = pushing, sideways_[place] = sideways;
        point_pushes_[place] = any((pushing != all(0)) | (sideways != all(0)));
      }
    }
    for (int64_t v = 0; v < plan_.voxels(); v++)
      for (int side = 0; side < SIDES; side++) {
        Lanes impulse = at(ROPE, side * array_voxels_ + plan_.voxel(v).number);
        rope_impulse_[SIDES * v + side] = impulse;
        rope_pushes_[SIDES * v + side] = any(impulse != all(0));
      }
  }

  // All rows of all arrays, for those of padding.
  void copy_padding(const State<const Number>& before, const State<Number>& after, int64_t points,
                    int64_t lanes, ethogram::Block block) {
    Rows rows(array_voxels_, numbers_ / COLOURS, points);
    if (plan_.bodies() == numbers_ && plan_.voxels() == array_voxels_) return;
    for (int field = 0; field < FIELDS; field++) {
      if (after.field[field] == before.field[field]) continue;
      for (int64_t row = 0; row < rows.field[field]; row++)
        store(after.field[field] + row * lanes, block,
              load(before.field[field] + row * lanes, block));
    }
  }

  void write(const State<Number>& state, int64_t points, int64_t lanes, ethogram::Block block) {
    auto put = [&](Field field, int64_t row, Lanes value) {
      store(state.field[field] + row * lanes, block, value);
    };
    for (int64_t b = 0; b < plan_.bodies(); b++) {
      int64_t x = plan_.body(b).number, y = x + numbers_, w = y + numbers_;
      const Place& place = place_[b];
      put(MOVED, x, place.moved.x), put(MOVED, y, place.moved.y);
      put(HEADING, x, place.heading.x), put(HEADING, y, place.heading.y);
      Vector3 v = velocity_[b], change = change_[b];
      put(VELOCITY, x, v.x), put(VELOCITY, y, v.y), put(VELOCITY, w, v.w);
      put(CHANGE, x, change.x), put(CHANGE, y, change.y), put(CHANGE, w, change.w);
      for (int64_t point = 0; point < points; point++) {
        put(CONTACT, 2 * point * numbers_ + x, pushing_[POINTS * b + point]);
        put(CONTACT, (2 * point + 1) * numbers_ + x, sideways_[POINTS * b + point]);
      }
    }
    for (int64_t v = 0; v < plan_.voxels(); v++)
      for (int side = 0; side < SIDES; side++)
        put(ROPE, side * array_voxels_ + plan_.voxel(v).number, rope_impulse_[SIDES * v + side]);
  }

  // Gravity and drag; the equations begin with the rigid bodies' own mass.
  void fall() {
    Lanes pull = gravity_ * all(-of_.time_step), kept = all(of_.kept), none = all(0);
    for (int64_t b = 0; b < plan_.bodies(); b++) {
      Vector3 v = velocity_[b];
      Vector3 free = {v.x * kept, (v.y + pull) * kept, v.w * kept}, change = change_[b];
      Lanes mass = all(plan_.body(b).mass), moment = all(plan_.body(b).moment);
      free_[b] = free;
      velocity_[b] = {free.x + change.x, free.y + change.y, free.w + change.w};
      system_[b] = {{mass, none, mass, none, none, moment},
                    {mass * free.x, mass * free.y, moment * free.w}};
    }
  }

  ETHOGRAM_INLINE void squares_of(const Voxel& voxel, Square* squares) const {
    Lanes half = all(of_.square / 2);
    for (int place = 0; place < PLACES; place++) {
      const Place& of = place_[voxel.body[place]];
      Vector2 lever = rotated(of.heading, all(voxel.offset_x[place], voxel.offset_y[place]));
      Lanes x = of.heading.x * half, y = of.heading.y * half;
      squares[place] = {lever, of.moved + lever, {x - y, y + x}, {x + y, y - x}};
    }
  }

  static ETHOGRAM_INLINE Vector2 apart(const Voxel& voxel, int pair) {
    return all(voxel.apart_x[pair], voxel.apart_y[pair]);
  }
  // From the centre of the first square of a pair to that of the second.
  static ETHOGRAM_INLINE Vector2 between(const Voxel& voxel, const Square* squares, int pair) {
    return squares[PAIR[pair][1]].at - squares[PAIR[pair][0]].at + apart(voxel, pair);
  }

  // Lengths of one kind of springs in a voxel that is contracted, at rest, expanded.
  struct Lengths {
    Lanes resting, contracts, expands;  // m; m per control above and below 0

    Lengths(double contracted, double at_rest, double expanded)
        : resting(all(static_cast<Number>(at_rest))),
          contracts(all(static_cast<Number>(contracted - at_rest))),
          expands(all(static_cast<Number>(at_rest - expanded))) {}

    ETHOGRAM_INLINE Lanes target(Lanes control) const {
      return fma(control, control >= all(0) ? contracts : expands, resting);
    }
  };

  template <class Length>
  Lengths lengths(Length of_edge) const {
    return Lengths(of_edge(of_.contracted), of_edge(of_.resting), of_edge(of_.expanded));
  }

  // Springs of all voxels: blocks, and what the equations of rigid bodies have of them; ropes.
  template <bool all_of_them>
  void springs() {
    const double side = of_.square;
    const Lengths sides = lengths([=](double edge) { return edge - 2 * side; });
    const Lengths crossed = lengths([=](double edge) {
      return sqrt(side * side + (edge - 2 * side) * (edge - 2 * side));
    });
    const Lengths diagonals = lengths([=](double edge) { return (edge - side) * sqrt(2.0); });
    rope_count_ = 0;
    for (int64_t v = 0; v < plan_.voxels(); v++) {
      const Voxel& voxel = plan_.voxel(v);
      Lanes control = control_[v];
      Square squares[PLACES];
      squares_of(voxel, squares);
      Lanes side_target = sides.target(control), crossed_target = crossed.target(control);
      join_side<all_of_them, 0>(voxel, squares, side_target, crossed_target);
      join_side<all_of_them, 1>(voxel, squares, side_target, crossed_target);
      join_side<all_of_them, 2>(voxel, squares, side_target, crossed_target);
      join_side<all_of_them, 3>(voxel, squares, side_target, crossed_target);
      Lanes diagonal_target = diagonals.target(control);
      join_diagonal<4>(voxel, squares, diagonal_target);
      join_diagonal<5>(voxel, squares, diagonal_target);
      find_ropes(v, voxel, squares);
    }
  }

  template <bool all_of_them, int pair>
  ETHOGRAM_INLINE void join_side(const Voxel& voxel, const Square* squares, Lanes target,
                                 Lanes crossed) {
    constexpr bool is_flat = pair < 2;           // whether the side lies along x
    constexpr int outer = pair & 1 ? 1 : -1;     // from the voxel's centre to the side
    const Square &one = squares[PAIR[pair][0]], &two = squares[PAIR[pair][1]];
    Vector2 apart = between(voxel, squares, pair);
    auto spring = [&](Pair& sum, int at_first, int at_second, Lanes length) {
      Vector2 arm_1 = is_flat ? one.corner(1, at_first) : one.corner(at_first, 1);
      Vector2 arm_2 = is_flat ? two.corner(-1, at_second) : two.corner(at_second, -1);
      add_spring<true>(sum, one, two, arm_1, arm_2, apart, length);
    };
    Pair sum = {};
    spring(sum, outer, outer, target);
    if (all_of_them) {
      spring(sum, -outer, -outer, target);
      spring(sum, outer, -outer, crossed);
      spring(sum, -outer, outer, crossed);
    }
    add_pair<pair>(voxel, sum);
  }

  template <int pair>
  ETHOGRAM_INLINE void join_diagonal(const Voxel& voxel, const Square* squares, Lanes target) {
    Pair sum = {};
    add_spring<false>(sum, squares[PAIR[pair][0]], squares[PAIR[pair][1]], Vector2{}, Vector2{},
                      between(voxel, squares, pair), target);
    add_pair<pair>(voxel, sum);
  }

  // One spring along d, of length l, of which k and e go with m_e and so, with n = d / l,
  //   m_e n n' = m_e / l^2 d d',  m_e / l^2 = 1 / (2 l^2 / m + ((a_1 x d)^2 + (a_2 x d)^2) / I),
  //   m_e (l - l*) n = m_e / l^2 (l^2 - l* l) d.
  template <bool has_arms>
  ETHOGRAM_INLINE void add_spring(Pair& sum, const Square& one, const Square& two, Vector2 arm_1,
                                  Vector2 arm_2, Vector2 between, Lanes target) const {
    Vector2 d = has_arms ? between + (arm_2 - arm_1) : between;
    Lanes square = larger(dot(d, d), all(static_cast<Number>(SHORTEST * SHORTEST)));
    Lanes turn_1 = cross(one.lever, d), turn_2 = cross(two.lever, d);
    Lanes softness = square * all(2 / of_.square_mass);
    if (has_arms) {
      Lanes own_1 = cross(arm_1, d), own_2 = cross(arm_2, d);
      softness = fma(all(6 / (of_.square_mass * of_.square * of_.square)),
                     fma(own_1, own_1, own_2 * own_2), softness);
      turn_1 += own_1, turn_2 += own_2;
    }
    Lanes reduced = all(1) / softness;
    Lanes k = reduced * all(of_.spring_inertia);
    Lanes e = reduced * all(of_.spring_pull) * fnma(target, root(square), square);
    Lanes kx = k * d.x, ky = k * d.y, k1 = k * turn_1, k2 = k * turn_2;
    sum.xx = fma(kx, d.x, sum.xx);
    sum.xy = fma(kx, d.y, sum.xy);
    sum.yy = fma(ky, d.y, sum.yy);
    sum.first = fma(k1, d, sum.first);
    sum.second = fma(k2, d, sum.second);
    sum.turn_11 = fma(k1, turn_1, sum.turn_11);
    sum.turn_12 = fma(k1, turn_2, sum.turn_12);
    sum.turn_22 = fma(k2, turn_2, sum.turn_22);
    sum.pull = fma(e, d, sum.pull);
    sum.pull_1 = fma(e, turn_1, sum.pull_1);
    sum.pull_2 = fma(e, turn_2, sum.pull_2);
  }

  template <int pair>
  ETHOGRAM_INLINE void add_pair(const Voxel& voxel, const Pair& sum) {
    System &one = system_[voxel.body[PAIR[pair][0]]], &two = system_[voxel.body[PAIR[pair][1]]];
    add(one, sum, sum.first, sum.turn_11, sum.pull, sum.pull_1);
    add(two, sum, sum.second, sum.turn_22, -sum.pull, -sum.pull_2);
    Block& block = blocks_[voxel.block[pair]];
    Vector2 first = sum.first, second = sum.second;
    if (voxel.is_first[pair]) {
      block = {sum.xx, sum.xy, sum.yy, sum.turn_12, first, second};
      return;
    }
    if (voxel.is_turned[pair]) first = sum.second, second = sum.first;
    block.xx += sum.xx, block.xy += sum.xy, block.yy += sum.yy, block.turning += sum.turn_12;
    block.first = block.first + first, block.second = block.second + second;
  }

  static ETHOGRAM_INLINE void add(System& to, const Pair& sum, Vector2 linear, Lanes angular,
                                  Vector2 pull, Lanes turning) {
    Matrix& m = to.inverse;  // not yet inverted
    m.xx += sum.xx, m.xy += sum.xy, m.yy += sum.yy;
    m.xw += linear.x, m.yw += linear.y, m.ww += angular;
    to.momentum.x += pull.x, to.momentum.y += pull.y, to.momentum.w += turning;
  }

  // Squares of a side, the first of which has the first colour, and the pair that they are.
  struct Side {
    int pair, first, second;

    Side(const Voxel& voxel, int side) {
      first = PAIR[side][0] ^ voxel.parity, second = PAIR[side][1] ^ voxel.parity;
      pair = side ^ (side < 2 ? voxel.parity >> 1 : voxel.parity & 1);
    }
  };

  static ETHOGRAM_INLINE Vector2 between(const Voxel& voxel, const Square* squares, Side side) {
    Vector2 found = between(voxel, squares, side.pair);
    return side.first == PAIR[side.pair][0] ? found : -found;
  }

  // List the sides that are too short, and forget the impulses of others.
  ETHOGRAM_INLINE void find_ropes(int64_t v, const Voxel& voxel, const Square* squares) {
    Lanes least = all(of_.square * of_.square), shortest = least + least;
    bool pushed = false;
    for (int side = 0; side < SIDES; side++) {
      Vector2 d = between(voxel, squares, side);
      shortest = smaller(dot(d, d), shortest);
      pushed |= rope_pushes_[SIDES * v + side];
    }
    if (!pushed && !any(shortest <= least)) return;
    for (int side = 0; side < SIDES; side++) {
      int64_t number = SIDES * v + side;
      Side at(voxel, side);
      Vector2 d = between(voxel, squares, at);
      Lanes square = larger(dot(d, d), all(static_cast<Number>(SHORTEST * SHORTEST)));
      Mask taut = square <= least;
      rope_impulse_[number] = taut ? rope_impulse_[number] : all(0);
      rope_pushes_[number] = any(taut);
      if (!rope_pushes_[number]) continue;
      Lanes per = all(1) / root(square);
      Vector2 n = {d.x * per, d.y * per};
      Rope& rope = ropes_[rope_count_++];
      rope.voxel = static_cast<int32_t>(v), rope.side = side, rope.taut = taut;
      rope.first = voxel.body[at.first], rope.second = voxel.body[at.second];
      rope.on_first.direction = -n, rope.on_second.direction = n;
      rope.on_first.turn = -cross(squares[at.first].lever, n);
      rope.on_second.turn = cross(squares[at.second].lever, n);
    }
  }

  // What a rope's impulse does, the rigid bodies' equations being known; that of the last step.
  void prepare(Rope& rope) {
    respond(rope.on_first, system_[rope.first].inverse);
    respond(rope.on_second, system_[rope.second].inverse);
    rope.per_speed = all(1) / (rope.on_first.softness() + rope.on_second.softness());
    Lanes impulse = rope_impulse_[SIDES * rope.voxel + rope.side];
    Vector3 ignored = {};
    rope.on_first.act(impulse, ignored, system_[rope.first].momentum);
    rope.on_second.act(impulse, ignored, system_[rope.second].momentum);
  }

  static ETHOGRAM_INLINE void respond(Push& push, const Matrix& inverse) {
    push.response = times(inverse, Vector3{push.direction.x, push.direction.y, push.turn});
  }

  void tighten(const Rope& rope) {
    Vector3 &first = velocity_[rope.first], &second = velocity_[rope.second];
    Lanes& impulse = rope_impulse_[SIDES * rope.voxel + rope.side];
    Lanes speed = rope.on_first.speed(first) + rope.on_second.speed(second);
    Lanes wanted = larger(fnma(speed, rope.per_speed, impulse), all(0));
    Lanes change = rope.taut ? wanted - impulse : all(0);
    impulse += change;
    rope.on_first.act(change, first, system_[rope.first].momentum);
    rope.on_second.act(change, second, system_[rope.second].momentum);
  }

  // Find the points that are in the terrain, rigid body after rigid body.
  void touch() {
    for (int64_t b = 0; b < plan_.bodies(); b++) {
      const Body& body = plan_.body(b);
      bool is_near = near_terrain(b);
      Vector2 local[POINTS];
      for (int square = 0; is_near && square < body.squares; square++) face(b, square, local);
      for (int point = 0; point < POINTS; point++) {
        int64_t place = POINTS * b + point;
        Contact& contact = contacts_[contact_count_];
        Mask touching = {};
        bool there = is_near && point % MEMBERS < body.squares;
        if (there) touching = touch(b, local[point], contact);
        if (point_pushes_[place]) {
          pushing_[place] = touching ? pushing_[place] : all(0);
          sideways_[place] = touching ? sideways_[place] : all(0);
        }
        point_pushes_[place] = there && any(touching);
        if (!point_pushes_[place]) continue;
        contact_count_++;
        contact.body = static_cast<int32_t>(b), contact.point = static_cast<int32_t>(place);
        Vector3 ignored = {}, &momentum = system_[b].momentum;
        contact.along.act(pushing_[place], ignored, momentum);
        contact.across.act(sideways_[place], ignored, momentum);
      }
    }
  }

  // Whether a corner of a rigid body may be in the terrain, in any lane.
  bool near_terrain(int64_t b) const {
    const Body& body = plan_.body(b);
    Vector2 centre = centre_of(b);
    // rounding errors of a depth go with the numbers that it is made of
    Lanes error = all(sizeof(Number) == 4 ? Number(0x1p-19) : Number(0x1p-48));
    Lanes radius = all(body.radius * Number(1.001));
    radius = fma(error, absolute(centre.x) + absolute(centre.y), radius);
    return near(plan_.ground(), plan_.ground_lines(), centre, radius, error) ||
           near(plan_.ceiling(), plan_.ceiling_lines(), centre, radius, error);
  }

  static ETHOGRAM_INLINE bool near(const Line* lines, int64_t count, Vector2 centre, Lanes radius,
                                   Lanes error) {
    Mask found = {};
    for (int64_t i = 0; i < count; i++) {
      const Line& line = lines[i];
      Lanes reach = all(line.reach);
      Lanes depth = fnma(centre.x, all(line.normal_x), fnma(centre.y, all(line.normal_y), reach));
      Mask inside = depth + fma(error, absolute(reach), radius) > all(0);
      if (i > 0) inside &= centre.x + radius >= all(line.from);
      if (i + 1 < count) inside &= centre.x - radius <= all(lines[i + 1].from);
      found |= inside;
    }
    return any(found);
  }

  // The two corners of a square that face the terrain the most, from the rigid body's centre.
  ETHOGRAM_INLINE void face(int64_t b, int square, Vector2* local) const {
    const Body& body = plan_.body(b);
    Vector2 heading = place_[b].heading;
    Vector2 offset = all(body.offset_x[square], body.offset_y[square]);
    Lanes depth;
    Vector2 n = deepest(centre_of(b) + rotated(heading, offset), depth).normal;
    Vector2 along = rotated({heading.x, -heading.y}, n);
    Mask upright = absolute(along.y) >= absolute(along.x);
    Lanes half = all(of_.square / 2), none = all(0);
    Vector2 towards = {along.x > none ? -half : half, along.y > none ? -half : half};
    for (int end = 0; end < 2; end++) {
      Lanes lateral = end ? half : -half;
      Vector2 corner = {upright ? lateral : towards.x, upright ? towards.y : lateral};
      local[end * MEMBERS + square] = offset + corner;
    }
  }

  // Lanes of which a point is in the terrain; then all that a contact's impulses need is known.
  ETHOGRAM_INLINE Mask touch(int64_t b, Vector2 local, Contact& contact) const {
    Vector2 lever = rotated(place_[b].heading, local);
    Lanes depth;
    Surface surface = deepest(centre_of(b) + lever, depth);
    Mask touching = depth > all(0);
    if (!any(touching)) return touching;
    Vector2 n = surface.normal;
    contact.touching = touching, contact.local = local, contact.reach = surface.reach;
    complete(contact.along, n, lever, system_[b].inverse);
    complete(contact.across, {n.y, -n.x}, lever, system_[b].inverse);
    Lanes approach = contact.along.speed(free_[b]);
    contact.rebound =
        approach < all(static_cast<Number>(-SLOWEST)) ? all(-of_.restitution) * approach : all(0);
    return touching;
  }

  ETHOGRAM_INLINE Vector2 centre_of(int64_t b) const {
    return place_[b].moved + all(plan_.body(b).rest_x, plan_.body(b).rest_y);
  }

  // The surface that a place is in the deepest, and how deep.
  ETHOGRAM_INLINE Surface deepest(Vector2 at, Lanes& depth) const {
    Surface ground = below(plan_.ground(), plan_.ground_lines(), at);
    depth = depth_in(ground, at);
    if (plan_.ceiling_lines() == 0) return ground;
    Surface ceiling = below(plan_.ceiling(), plan_.ceiling_lines(), at);
    Lanes depth_above = depth_in(ceiling, at);
    Mask is_above = depth_above > depth;
    depth = is_above ? depth_above : depth;
    return {choose(is_above, ceiling.normal, ground.normal),
            is_above ? ceiling.reach : ground.reach};
  }

  // The piece of a polyline below, or above, a place.
  static ETHOGRAM_INLINE Surface below(const Line* lines, int64_t count, Vector2 at) {
    Surface found = {all(lines->normal_x, lines->normal_y), all(lines->reach)};
    for (const Line* line = lines + 1; line < lines + count; line++) {
      Mask beyond = at.x >= all(line->from);
      found.normal = choose(beyond, all(line->normal_x, line->normal_y), found.normal);
      found.reach = beyond ? all(line->reach) : found.reach;
    }
    return found;
  }

  static ETHOGRAM_INLINE Lanes depth_in(Surface surface, Vector2 at) {
    return surface.reach - dot(at, surface.normal);
  }

  static ETHOGRAM_INLINE void complete(Push& push, Vector2 direction, Vector2 lever,
                                       const Matrix& inverse) {
    push.direction = direction;
    push.turn = cross(lever, direction);
    respond(push, inverse);
    push.per_speed = all(1) / push.softness();
  }

  // Velocities of all rigid bodies, colour after colour, with those of the others as they are.
  void colours() {
    for (int64_t b = 0; b < plan_.bodies(); b++) {
      const Body& body = plan_.body(b);
      Vector3 momentum = system_[b].momentum;
      for (int link = 0; link < body.links; link++) {
        const Link& to = body.link[link];
        const Block& block = blocks_[to.block];
        const Vector2 &mine = to.is_second ? block.second : block.first,
                      &its = to.is_second ? block.first : block.second;
        const Vector3 v = velocity_[to.body];
        momentum.x = fma(block.xx, v.x, fma(block.xy, v.y, fma(its.x, v.w, momentum.x)));
        momentum.y = fma(block.xy, v.x, fma(block.yy, v.y, fma(its.y, v.w, momentum.y)));
        momentum.w = fma(mine.x, v.x, fma(mine.y, v.y, fma(block.turning, v.w, momentum.w)));
      }
      velocity_[b] = times(system_[b].inverse, momentum);
    }
  }

  // The normal, then the tangent, at most mu times what the normal has.
  void resolve(const Contact& contact) {
    Vector3 &velocity = velocity_[contact.body], &momentum = system_[contact.body].momentum;
    Lanes &pushing = pushing_[contact.point], &sideways = sideways_[contact.point];
    Lanes lacking = contact.rebound - contact.along.speed(velocity);
    Lanes wanted = larger(fma(lacking, contact.along.per_speed, pushing), all(0));
    wanted = contact.touching ? wanted : all(0);
    contact.along.act(wanted - pushing, velocity, momentum);
    pushing = wanted;
    Lanes limit = all(of_.friction) * pushing;
    wanted = fnma(contact.across.speed(velocity), contact.across.per_speed, sideways);
    wanted = contact.touching ? smaller(larger(wanted, -limit), limit) : all(0);
    contact.across.act(wanted - sideways, velocity, momentum);
    sideways = wanted;
  }

  // Semi-implicit Euler.
  void move() {
    Lanes time = all(of_.time_step);
    for (int64_t b = 0; b < plan_.bodies(); b++) {
      Vector3 v = velocity_[b], free = free_[b];
      Place& place = place_[b];
      change_[b] = {v.x - free.x, v.y - free.y, v.w - free.w};
      place.moved = fma(time, {v.x, v.y}, place.moved);
      place.heading = turned(place.heading, time * v.w);
    }
  }

  // A heading turned by an angle, of length 1 again: h (3 - h^2) / 2 where it almost is.
  static ETHOGRAM_INLINE Vector2 turned(Vector2 heading, Lanes angle) {
    Vector2 after = rotated(direction(angle), heading);
    Lanes per_length = fnma(all(0.5), dot(after, after), all(1.5));
    return {after.x * per_length, after.y * per_length};
  }

  // Cosine and sine by Taylor's series, sin = angle (1 - z/6 (1 - z/20 (1 - ...))), z = angle^2.
  static ETHOGRAM_INLINE Vector2 direction(Lanes angle) {
    constexpr int TERMS = sizeof(Number) == 4 ? 5 : 9;
    Lanes square = angle * angle, cosine = all(1), sine = all(1);
    for (int term = TERMS; term > 0; term--) {
      const double even = 2 * term;
      cosine = fnma(square * all(static_cast<Number>(1 / ((even - 1) * even))), cosine, all(1));
      sine = fnma(square * all(static_cast<Number>(1 / (even * (even + 1)))), sine, all(1));
    }
    sine *= angle;
    if (any(absolute(angle) > all(static_cast<Number>(SERIES_END))))
      for (int lane = 0; lane < LANES<Number>; lane++) {
        if (!(fabs(static_cast<double>(angle[lane])) > SERIES_END)) continue;
        cosine[lane] = static_cast<Number>(cos(static_cast<double>(angle[lane])));
        sine[lane] = static_cast<Number>(sin(static_cast<double>(angle[lane])));
      }
    return {cosine, sine};
  }

  // Move apart what overlaps, in passes, until nothing does; of ropes those of robots that have one
  // that is too short before.
  void correct() {
    Mask is_short = any_short();
    bool ropes = any(is_short);
    if (!ropes && contact_count_ == 0) return;
    for (int pass = 0; pass < PASSES; pass++) {
      bool has_moved = ropes && lengthen(is_short);
      for (int64_t c = 0; c < contact_count_; c++) has_moved |= lift(contacts_[c]);
      if (!has_moved) return;
    }
  }

  Mask any_short() const {
    Number length = of_.square - static_cast<Number>(SLOP);
    Lanes shortest = all(length * length);
    Mask found = {};
    for (int64_t v = 0; v < plan_.voxels(); v++) {
      const Voxel& voxel = plan_.voxel(v);
      Vector2 at[PLACES];
      for (int place = 0; place < PLACES; place++) at[place] = square_at(voxel, place);
      for (int side = 0; side < SIDES; side++) {
        Vector2 d = at[PAIR[side][1]] - at[PAIR[side][0]] + apart(voxel, side);
        found |= dot(d, d) < shortest;
      }
    }
    return found;
  }

  ETHOGRAM_INLINE Vector2 lever_of(const Voxel& voxel, int place) const {
    return rotated(place_[voxel.body[place]].heading,
                   all(voxel.offset_x[place], voxel.offset_y[place]));
  }
  ETHOGRAM_INLINE Vector2 square_at(const Voxel& voxel, int place) const {
    return place_[voxel.body[place]].moved + lever_of(voxel, place);
  }

  // One pass over the ropes; whether any was too short.
  bool lengthen(Mask lanes) {
    Lanes length = all(of_.square - static_cast<Number>(SLOP));
    bool has_moved = false;
    for (int64_t v = 0; v < plan_.voxels(); v++) {
      const Voxel& voxel = plan_.voxel(v);
      for (int side = 0; side < SIDES; side++) {
        Side of(voxel, side);
        Vector2 d = square_at(voxel, of.second) - square_at(voxel, of.first);
        Vector2 rest = apart(voxel, of.pair);
        d = of.first == PAIR[of.pair][0] ? d + rest : d - rest;
        Lanes square = larger(dot(d, d), all(static_cast<Number>(SHORTEST * SHORTEST)));
        Lanes distance = root(square);
        Mask moves = lanes & (distance < length);
        if (!any(moves)) continue;
        has_moved = true;
        Vector2 n = {d.x / distance, d.y / distance};
        const Body& one = plan_.body(voxel.body[of.first]);
        const Body& two = plan_.body(voxel.body[of.second]);
        Lanes turn_1 = cross(lever_of(voxel, of.first), n);
        Lanes turn_2 = cross(lever_of(voxel, of.second), n);
        Lanes softness = fma(turn_1 * turn_1, all(one.per_moment),
                             fma(turn_2 * turn_2, all(two.per_moment),
                                 all(one.per_mass + two.per_mass)));
        Lanes push = smaller(length - distance, all(static_cast<Number>(FARTHEST))) / softness;
        shift(voxel.body[of.first], moves, -push, n, turn_1);
        shift(voxel.body[of.second], moves, push, n, turn_2);
      }
    }
    return has_moved;
  }

  // Lift a rigid body out of what a corner of it overlaps; whether it did.
  bool lift(const Contact& contact) {
    const Body& body = plan_.body(contact.body);
    Vector2 lever = rotated(place_[contact.body].heading, contact.local);
    Vector2 n = contact.along.direction;
    Lanes depth = contact.reach - dot(centre_of(contact.body) + lever, n);
    Lanes share = all(static_cast<Number>(CORRECTED)) * (depth - all(static_cast<Number>(SLOP)));
    Mask moves = contact.touching & (share > all(0));
    if (!any(moves)) return false;
    Lanes turn = cross(lever, n);
    Lanes push = smaller(share, all(static_cast<Number>(FARTHEST))) /
                 fma(turn * turn, all(body.per_moment), all(body.per_mass));
    shift(contact.body, moves, push, n, turn);
    return true;
  }

  ETHOGRAM_INLINE void shift(int64_t b, Mask lanes, Lanes push, Vector2 n, Lanes turn) {
    Place& place = place_[b];
    Lanes way = push * all(plan_.body(b).per_mass);
    place.moved = choose(lanes, fma(way, n, place.moved), place.moved);
    Vector2 heading = turned(place.heading, push * turn * all(plan_.body(b).per_moment));
    place.heading = choose(lanes, heading, place.heading);
  }

  const Plan<Number> plan_;
  const Constants<Number> of_;
  const int64_t numbers_, array_voxels_;  // of rigid bodies and of voxels in arrays
  const bool all_springs_, has_terrain_;
  const int64_t sweeps_;
  Place* const place_;
  Vector3 *const velocity_, *const free_, *const change_;
  System* const system_;
  Block* const blocks_;
  Lanes* const control_;
  Lanes* const rope_impulse_;    // [voxel, side by colour]
  uint8_t* const rope_pushes_;   // whether an impulse may not be 0, in any lane
  Rope* const ropes_;
  Lanes *const pushing_, *const sideways_;  // [rigid body, point]
  uint8_t* const point_pushes_;  // whether an impulse may not be 0, in any lane
  Contact* const contacts_;
  int64_t rope_count_ = 0, contact_count_ = 0;
  Lanes gravity_ = {};
};

}  // namespace lattice2d
}  // namespace ethogram
