// Soft bodies as lattices of elastic beams: many steps of a block of robots that lie side by side.
//
// The model, and the names of its parts, are those of `ethogram.physics.beams3d`, where each formula
// has its source; equations are written here only where they are turned into another form.  A block
// is copied from the state's arrays into records of one vector per number, stepped there, in the
// processor's cache, and copied back.
//
// Differences in form, none in what is computed:
// - a voxel's rotation is a matrix, made once a step, where a bond would rotate by quaternions;
// - a bond's grid axis is known when this is compiled, so that turning it to x costs nothing;
// - what only bent bonds, touching voxels or voxels in the floor need is left out of a block none of
//   whose lanes has any; a lane for which it was not left out has the same bits;
// - bonds and pairs that are padding are left out;
// - rates are differences: what damps them is divided by the time step beforehand;
// - pairs that could touch are looked at only where the state's clearance is used up.

#pragma once

#include "lanes.h"

namespace ethogram {
namespace beams3d {

using ethogram::fma;
using ethogram::fnma;

constexpr double SMALL_ANGLE = 0.01732;      // rad
constexpr double BECOMES_SMALL_W = 0.9999625024343469;  // cos(SMALL_ANGLE / 2)
constexpr double CEASES_SMALL_W = 0.9999546280051071;   // cos(1.1 SMALL_ANGLE / 2)
constexpr double BECOMES_SMALL_TURN = 0.05, CEASES_SMALL_TURN = 0.055;
constexpr double BECOMES_SMALL_EXTENSION = 1.30, CEASES_SMALL_EXTENSION = 1.43;
constexpr double SMALL_W = 0.9988;           // below it, an angle is taken from its cosine
constexpr double NEARLY_BACKWARDS = 5e-15;   // 1 + cos(pi - 1e-7)
constexpr double TOUCH = 0.75;               // times the sum of two edges
constexpr double MAX_STRAIN = 100.0;
constexpr double FAR_APART = 1e30;           // m
constexpr double PI = 3.14159265358979323846;

// The state's arrays: components first, then voxels or bonds, then lanes.
template <class Number, class Flag, class Count>
struct State {
  Number *position, *orientation, *momentum, *angular_momentum, *force, *edge, *strain;
  Flag* small;
  Number* deformation;
  Count* steps;  // one each, or one for all
  Flag* diverged;
  Number* clearance;
};

struct Lattice {
  int64_t voxels, bonds, pairs;
  const int32_t *first, *second, *axis, *left, *right;
  const uint8_t *bond_used, *pair_used;
};

// What is commanded: edge [step, voxel, lane], gravity [step, 3] or [step, 3, lane].
template <class Number>
struct Commands {
  int64_t steps;
  const Number *edge, *gravity;
  bool gravity_is_shared, count_is_shared;
};

// In the order in which `ethogram.physics.beams3d.kernel.constants` gives them.
template <class Number>
struct Constants {
  Number axial, twist, shear, shear_bend, bend;                                  // stiffness
  Number damped_axial, damped_twist, damped_shear, damped_shear_bend, damped_bend;  // per step
  Number time_step, mass, inertia, drag, spin_decay;
  Number floor_stiffness, floor_drag, static_friction, dynamic_friction;
};

template <class Lanes>
struct Vector3 {
  Lanes x, y, z;
};

template <class Lanes>
struct Quaternion {
  Lanes w, x, y, z;
};

template <class Lanes>
struct Beam {
  Lanes axial, shear, shear_bend;        // force per stretch, displacement across, bend
  Lanes twist, shear_bend_moment, bend;  // moment per twist, displacement across, bend
};

// d (m), th1, th2 (rad), without the component of th1 along x, which is none.
template <class Lanes>
struct Deformation {
  Lanes x, y, z, y1, z1, x2, y2, z2;
};

// Force on the first voxel and the two moments; those along x are -twist and twist.
template <class Lanes>
struct Pull {
  Lanes x, y, z, twist, y1, z1, y2, z2;
};

template <class Lanes>
ETHOGRAM_INLINE Vector3<Lanes> operator+(Vector3<Lanes> a, Vector3<Lanes> b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class Lanes>
ETHOGRAM_INLINE Vector3<Lanes> operator-(Vector3<Lanes> a, Vector3<Lanes> b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class Lanes>
ETHOGRAM_INLINE Lanes dot(Vector3<Lanes> a, Vector3<Lanes> b) {
  return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z));
}

// A scaled by s, added to b.
template <class Lanes>
ETHOGRAM_INLINE Vector3<Lanes> fma(Lanes s, Vector3<Lanes> a, Vector3<Lanes> b) {
  return {fma(s, a.x, b.x), fma(s, a.y, b.y), fma(s, a.z, b.z)};
}
template <class Lanes>
ETHOGRAM_INLINE Vector3<Lanes> fnma(Lanes s, Vector3<Lanes> a, Vector3<Lanes> b) {
  return {fnma(s, a.x, b.x), fnma(s, a.y, b.y), fnma(s, a.z, b.z)};
}

// The rotation of a unit quaternion, by columns.
template <class Lanes>
struct Matrix {
  Vector3<Lanes> x, y, z;

  static ETHOGRAM_INLINE Matrix of(Quaternion<Lanes> q) {
    Lanes one = broadcast((decltype(q.w[0] + 0))1);
    Lanes x2 = q.x + q.x, y2 = q.y + q.y, z2 = q.z + q.z;
    Lanes wx = q.w * x2, wy = q.w * y2, wz = q.w * z2, xx = q.x * x2, zz = q.z * z2;
    return {{one - fma(q.y, y2, zz), fma(q.x, y2, wz), fma(q.x, z2, -wy)},
            {fma(q.x, y2, -wz), one - (xx + zz), fma(q.y, z2, wx)},
            {fma(q.x, z2, wy), fma(q.y, z2, -wx), one - fma(q.y, y2, xx)}};
  }
  ETHOGRAM_INLINE Vector3<Lanes> rotate(Vector3<Lanes> v) const {
    return {fma(x.x, v.x, fma(y.x, v.y, z.x * v.z)), fma(x.y, v.x, fma(y.y, v.y, z.y * v.z)),
            fma(x.z, v.x, fma(y.z, v.y, z.z * v.z))};
  }
  ETHOGRAM_INLINE Vector3<Lanes> rotate_back(Vector3<Lanes> v) const {
    return {dot(x, v), dot(y, v), dot(z, v)};
  }
};

// A vector with the bond's grid axis turned into x, and one with x turned back.
template <int axis, class Lanes>
ETHOGRAM_INLINE Vector3<Lanes> along_x(Vector3<Lanes> v) {
  if (axis == 0) return v;
  if (axis == 1) return {v.y, -v.x, v.z};
  return {v.z, v.y, -v.x};
}
template <int axis, class Lanes>
ETHOGRAM_INLINE Vector3<Lanes> from_x(Vector3<Lanes> v) {
  if (axis == 0) return v;
  if (axis == 1) return {-v.y, v.x, v.z};
  return {-v.z, v.y, v.x};
}

// 2 acos(w) / sqrt(1 - w^2) where w is between -SMALL_W and SMALL_W; anything elsewhere.
inline Floats far_angle(Floats w) {
  // acos(w) / sqrt(1 - w^2) on [0, 1], in powers of 1 - w, fitted by Remez' exchange: the relative
  // error is 1.5e-8, and 9e-8 with that of rounding.  acos(-w) = pi - acos(w) gives the other half.
  constexpr float SERIES[] = {0.9999999853133497f,  0.3333361075593302f,   0.13324698474699834f,
                              0.058180881302134745f, 0.019110222819572857f, 0.03312437489194622f,
                              -0.03878816316163866f, 0.05618296079878986f,  -0.0353829733086158f,
                              0.011785931146379141f};
  constexpr int TERMS = sizeof SERIES / sizeof SERIES[0];
  Floats one = broadcast(1.0f), left = one - absolute(w), half = broadcast(SERIES[TERMS - 1]);
  for (int term = TERMS - 2; term >= 0; term--) half = fma(half, left, broadcast(SERIES[term]));
  Floats beyond = broadcast((float)PI) / root(fnma(w, w, one)) - half;
  half = w < broadcast(0.0f) ? beyond : half;
  return half + half;
}
inline Doubles far_angle(Doubles w) {
  Doubles angle, one = broadcast(1.0);
  for (int lane = 0; lane < LANES<double>; lane++) angle[lane] = acos(w[lane]);
  return (angle + angle) / root(fnma(w, w, one));
}

// 2 sqrt(2 / (1 + w)) = 2 (1 - h)^(-1/2), h = (1 - w) / 2, for w above SMALL_W: to the last bit but
// one of the type.
ETHOGRAM_INLINE Floats near_angle(Floats w) {
  Floats h = fnma(broadcast(0.5f), w, broadcast(0.5f));
  Floats sum = fma(h, broadcast(5.0f / 8), broadcast(3.0f / 4));
  return fma(h, fma(h, sum, broadcast(1.0f)), broadcast(2.0f));
}
ETHOGRAM_INLINE Doubles near_angle(Doubles w) {
  Doubles h = fnma(broadcast(0.5), w, broadcast(0.5));
  Doubles sum = fma(h, broadcast(63.0 / 128), broadcast(35.0 / 64));
  sum = fma(h, fma(h, sum, broadcast(5.0 / 8)), broadcast(3.0 / 4));
  return fma(h, fma(h, sum, broadcast(1.0)), broadcast(2.0));
}

// Steps of the robots of one block, then of the next.
template <class Number>
class Simulation {
  typedef ethogram::Vector<Number> Lanes;
  typedef ethogram::Mask<Number> Mask;
  typedef beams3d::Vector3<Lanes> Vector3;
  typedef beams3d::Quaternion<Lanes> Quaternion;
  typedef beams3d::Deformation<Lanes> Deformation;
  typedef beams3d::Pull<Lanes> Pull;
  typedef beams3d::Beam<Lanes> Beam;

  typedef State<const Number, const uint8_t, const int32_t> Before;
  typedef State<Number, uint8_t, int32_t> After;

  struct Voxel {
    Vector3 position, momentum, angular_momentum;
    Quaternion orientation;
    Lanes edge;
    Matrix<Lanes> rotation;
    Vector3 force, torque;  // sums so far; after a step, force is the change of momentum per time
  };

  struct Bond {
    Mask small;
    Deformation memory;
    Lanes strain;
  };

  // A relative error that covers the rounding of a distance and of what is subtracted from it.
  static constexpr double ROUNDING = 16 * (sizeof(Number) == 4 ? 0x1p-23 : 0x1p-52);

 public:
  // Bytes of memory that a block needs, aligned to a vector.
  static size_t memory(const Lattice& lattice) {
    return lattice.voxels * sizeof(Voxel) + lattice.bonds * sizeof(Bond);
  }

  Simulation(const Lattice& lattice, const Constants<Number>& of, bool has_floor, void* memory)
      : lattice_(lattice),
        has_floor_(has_floor),
        voxels_(static_cast<Voxel*>(memory)),
        bonds_(reinterpret_cast<Bond*>(voxels_ + lattice.voxels)),
        beam_{all(of.axial), all(of.shear),      all(of.shear_bend),
              all(of.twist), all(of.shear_bend), all(of.bend)},
        // moments are damped half as much as forces
        dashpot_{all(of.damped_axial),     all(of.damped_shear),
                 all(of.damped_shear_bend), all(of.damped_twist / 2),
                 all(of.damped_shear_bend / 2), all(of.damped_bend / 2)},
        time_(all(of.time_step)),
        per_time_(all(1 / of.time_step)),
        mass_(all(of.mass)),
        move_(all(of.time_step / of.mass)),
        turn_(all(of.time_step / 2 / of.inertia)),
        drag_(all(of.drag)),
        spin_decay_(all(of.spin_decay)),
        floor_stiffness_(all(of.floor_stiffness)),
        floor_drag_(all(of.floor_drag)),
        static_friction_(all(of.static_friction)),
        dynamic_friction_(all(of.dynamic_friction)) {}

  // All steps of a block, from one state's arrays to another's, which may be the same.
  void run(const Before& before, const Commands<Number>& commands,
           const After& after, int64_t lanes, Block block) {
    read(before, lanes, block);
    first_step_ = load_zeros<Number>(before.steps, commands.count_is_shared ? Block{0, 1} : block);
    for (int64_t step = 0; step < commands.steps; step++) {
      command(commands, step, lanes, block);
      bond_forces(step == commands.steps - 1);
      self_collisions();
      move();
      first_step_ = Mask{};
    }
    write(after, lanes, block);
  }

 private:
  static ETHOGRAM_INLINE Lanes all(Number value) { return broadcast(value); }

  void read(const Before& state, int64_t lanes, Block block) {
    for (int64_t v = 0; v < lattice_.voxels; v++) {
      auto at = [&](const Number* array, int64_t component) {
        return load(array + (component * lattice_.voxels + v) * lanes, block);
      };
      auto vector = [&](const Number* array) {
        return Vector3{at(array, 0), at(array, 1), at(array, 2)};
      };
      Voxel& voxel = voxels_[v];
      voxel.position = vector(state.position);
      voxel.momentum = vector(state.momentum);
      voxel.angular_momentum = vector(state.angular_momentum);
      voxel.orientation = {at(state.orientation, 0), at(state.orientation, 1),
                           at(state.orientation, 2), at(state.orientation, 3)};
      voxel.edge = at(state.edge, 0);
      voxel.rotation = Matrix<Lanes>::of(voxel.orientation);
    }
    for (int64_t b = 0; b < lattice_.bonds; b++) {
      auto at = [&](int64_t component) {
        return load(state.deformation + (component * lattice_.bonds + b) * lanes, block);
      };
      Bond& bond = bonds_[b];
      bond.small = load_flags<Number>(state.small + b * lanes, block);
      bond.memory = {at(0), at(1), at(2), at(4), at(5), at(6), at(7), at(8)};
      bond.strain = all(0);
    }
    diverged_ = load_flags<Number>(state.diverged, block);
    clearance_ = load(state.clearance, block);
  }

  void write(const After& state, int64_t lanes, Block block) {
    Lanes none = all(0);
    for (int64_t v = 0; v < lattice_.voxels; v++) {
      auto put = [&](Number* array, int64_t component, Lanes value) {
        store(array + (component * lattice_.voxels + v) * lanes, block, value);
      };
      auto put_vector = [&](Number* array, Vector3 value) {
        put(array, 0, value.x), put(array, 1, value.y), put(array, 2, value.z);
      };
      const Voxel& voxel = voxels_[v];
      put_vector(state.position, voxel.position);
      put_vector(state.momentum, voxel.momentum);
      put_vector(state.angular_momentum, voxel.angular_momentum);
      put_vector(state.force, voxel.force);
      put(state.orientation, 0, voxel.orientation.w);
      put(state.orientation, 1, voxel.orientation.x);
      put(state.orientation, 2, voxel.orientation.y);
      put(state.orientation, 3, voxel.orientation.z);
      put(state.edge, 0, voxel.edge);
      // what is not finite stays so: to look once is enough; NaN - NaN and inf - inf are not 0
      Vector3 p = voxel.position;
      diverged_ |= (p.x - p.x != none) | (p.y - p.y != none) | (p.z - p.z != none);
    }
    for (int64_t b = 0; b < lattice_.bonds; b++) {
      const Bond& bond = bonds_[b];
      const Deformation& d = bond.memory;
      const Lanes rows[] = {d.x, d.y, d.z, none, d.y1, d.z1, d.x2, d.y2, d.z2};
      for (int64_t row = 0; row < 9; row++)
        store(state.deformation + (row * lattice_.bonds + b) * lanes, block, rows[row]);
      store_flags<Number>(state.small + b * lanes, block, bond.small);
      store(state.strain + b * lanes, block, bond.strain);
    }
    store_flags<Number>(state.diverged, block, diverged_);
    store(state.clearance, block, clearance_);
  }

  // Command the edges of a step, and begin the sums of forces with gravity and drag.
  void command(const Commands<Number>& commands, int64_t step, int64_t lanes, Block block) {
    Lanes pull[3], most = all(0);
    for (int64_t i = 0; i < 3; i++) {
      int64_t row = 3 * step + i;
      Lanes gravity = commands.gravity_is_shared ? all(commands.gravity[row])
                                                 : load(commands.gravity + row * lanes, block);
      pull[i] = mass_ * gravity;
    }
    for (int64_t v = 0; v < lattice_.voxels; v++) {
      Voxel& voxel = voxels_[v];
      Lanes edge = load(commands.edge + (step * lattice_.voxels + v) * lanes, block);
      most = larger(absolute(edge - voxel.edge), most);
      voxel.edge = edge;
      voxel.force = fnma(drag_, voxel.momentum, Vector3{pull[0], pull[1], pull[2]});
      voxel.torque = {all(0), all(0), all(0)};
    }
    spend(all(2 * TOUCH) * most);
  }

  void bond_forces(bool is_last) {
    for (int64_t b = 0; b < lattice_.bonds; b++) {
      if (lattice_.bond_used && !lattice_.bond_used[b]) continue;
      Voxel &one = voxels_[lattice_.first[b]], &two = voxels_[lattice_.second[b]];
      switch (lattice_.axis[b]) {
        case 0: bond_force<0>(one, two, bonds_[b], is_last); break;
        case 1: bond_force<1>(one, two, bonds_[b], is_last); break;
        default: bond_force<2>(one, two, bonds_[b], is_last);
      }
    }
  }

  template <int axis>
  void bond_force(Voxel& one, Voxel& two, Bond& bond, bool is_last) {
    Vector3 seen = along_x<axis>(one.rotation.rotate_back(two.position - one.position));
    Quaternion bend = difference<axis>(one.orientation, two.orientation);
    Lanes rest = (one.edge + two.edge) * all(0.5);
    // length and length at rest, both turned round where that is below 0, so as not to divide
    Lanes stretched = with_sign_of(rest, seen.x), resting = absolute(rest);
    diverged_ |= stretched > all(MAX_STRAIN + 1) * resting;
    if (is_last) bond.strain = seen.x / rest - all(1);

    Mask small = small_angles(bond.small, bend, seen, stretched, resting);
    Mask flipped = small ^ bond.small, undamped = flipped | first_step_;
    Mask large = ~small & (seen.x == seen.x);  // what is no number bends no other lane's way
    bool is_bent = any(large);
    Lanes factor = near_angle(bend.w);
    Deformation d = {seen.x - rest,   seen.y,          seen.z,         all(0), all(0),
                     factor * bend.x, factor * bend.y, factor * bend.z};
    Quaternion aligned;
    if (is_bent) aligned = deform_large(large, seen, bend, rest, d);

    Deformation& memory = bond.memory;
    Deformation rate = {d.x - memory.x,   d.y - memory.y,   d.z - memory.z,   d.y1 - memory.y1,
                        d.z1 - memory.z1, d.x2 - memory.x2, d.y2 - memory.y2, d.z2 - memory.z2};
    if (any(undamped)) {
      rate = choose(undamped, Deformation{}, rate);
      memory = choose(flipped, memory, d);
    } else {
      memory = d;
    }
    bond.small = small;
    Pull pull = beam_forces(dashpot_, rate, beam_forces(beam_, d, Pull{}));
    Vector3 force = {pull.x, pull.y, pull.z}, moment1 = {-pull.twist, pull.y1, pull.z1},
            moment2 = {pull.twist, pull.y2, pull.z2};
    if (is_bent) {
      force = choose(large, rotate_back(aligned, force), force);
      moment1 = choose(large, rotate_back(aligned, moment1), moment1);
      moment2 = choose(large, rotate_back(aligned, moment2), moment2);
    }
    force = one.rotation.rotate(from_x<axis>(force));
    one.force = one.force + force;
    two.force = two.force - force;
    one.torque = one.torque - one.rotation.rotate(from_x<axis>(moment1));
    two.torque = two.torque - one.rotation.rotate(from_x<axis>(moment2));
  }

  // The second orientation as the first sees it, q1^-1 q2, with the bond's grid axis turned into x.
  template <int axis>
  static ETHOGRAM_INLINE Quaternion difference(Quaternion p, Quaternion q) {
    Lanes w = fma(p.w, q.w, fma(p.x, q.x, fma(p.y, q.y, p.z * q.z)));
    Vector3 bend = along_x<axis>(
        Vector3{fma(p.w, q.x, fnma(p.x, q.w, fnma(p.y, q.z, p.z * q.y))),
                fma(p.w, q.y, fnma(p.y, q.w, fnma(p.z, q.x, p.x * q.z))),
                fma(p.w, q.z, fnma(p.z, q.w, fnma(p.x, q.y, p.y * q.x)))});
    return {w, bend.x, bend.y, bend.z};
  }

  // Whether a bond's angles are small.  A turn (|y| + |z|) / x is below 0 behind the first voxel.
  static ETHOGRAM_INLINE Mask small_angles(Mask before, Quaternion bend, Vector3 seen,
                                           Lanes stretched, Lanes resting) {
    Lanes across = absolute(seen.y) + absolute(seen.z), none = all(0);
    Mask becomes = (bend.w > all(BECOMES_SMALL_W)) &
                   ((across < all(BECOMES_SMALL_TURN) * seen.x) | (seen.x < none)) &
                   (stretched < all(BECOMES_SMALL_EXTENSION) * resting);
    Mask ceases = (bend.w <= all(CEASES_SMALL_W)) |
                  ((across > all(CEASES_SMALL_TURN) * seen.x) & (seen.x >= none)) |
                  (stretched > all(CEASES_SMALL_EXTENSION) * resting);
    return (before & ~ceases) | (~before & becomes);
  }

  // The deformation of lanes whose angles are large, and the rotation that takes `seen` to x.
  static Quaternion deform_large(Mask large, Vector3 seen, Quaternion bend, Lanes rest,
                                 Deformation& d) {
    Lanes length = root(dot(seen, seen));
    Quaternion aligned = to_x_axis(seen, length);
    Lanes factor1 = angle_factor(aligned.w);
    // aligned * bend; aligned has no x
    Quaternion turned = {
        fma(aligned.w, bend.w, fnma(aligned.y, bend.y, -(aligned.z * bend.z))),
        fma(aligned.w, bend.x, fma(aligned.y, bend.z, -(aligned.z * bend.y))),
        fma(aligned.w, bend.y, fma(aligned.y, bend.w, aligned.z * bend.x)),
        fma(aligned.w, bend.z, fma(aligned.z, bend.w, -(aligned.y * bend.x)))};
    Lanes factor2 = angle_factor(turned.w);
    d = choose(large,
               Deformation{length - rest, all(0), all(0), factor1 * aligned.y, factor1 * aligned.z,
                           factor2 * turned.x, factor2 * turned.y, factor2 * turned.z},
               d);
    return aligned;
  }

  static ETHOGRAM_INLINE Quaternion to_x_axis(Vector3 v, Lanes length) {
    Lanes bound = all(SMALL_ANGLE) * absolute(v.x), one = all(1), half = all(0.5);
    Mask small = (absolute(v.y) < bound) & (absolute(v.z) < bound);
    Lanes half_per_x = half / v.x;
    Lanes first_y = v.z * half_per_x, first_z = -(v.y * half_per_x);
    Lanes first_w = fnma(half, fma(first_y, first_y, first_z * first_z), one);
    Lanes per_length = one / length;
    Lanes raised = fma(v.x, per_length, one);  // 1 + cos(t)
    Mask backwards = raised < all(NEARLY_BACKWARDS);
    raised = backwards ? one : raised;
    Lanes k = per_length / root(raised + raised);
    return {small ? first_w : backwards ? all(0) : root(raised * half), all(0),
            small ? first_y : backwards ? one : v.z * k,
            small ? first_z : backwards ? all(0) : -(v.y * k)};
  }

  // The angle of a rotation per length of its vector part.
  static ETHOGRAM_INLINE Lanes angle_factor(Lanes w) {
    Mask near = w > all(SMALL_W);
    Lanes factor = near_angle(w);
    if (any(~near)) {
      Lanes left = all(1) + w;  // to a full turn
      Lanes around = left > all(0) ? root(all(8) / left) : all(0);
      factor = near ? factor : w < all(-SMALL_W) ? around : far_angle(w);
    }
    return factor;
  }

  // Forces and moments of a linear beam, added to some.
  static ETHOGRAM_INLINE Pull beam_forces(const Beam& beam, Deformation d, Pull to) {
    Lanes y = d.y1 + d.y2, z = d.z1 + d.z2;
    return {fma(beam.axial, d.x, to.x),
            fma(beam.shear, d.y, fnma(beam.shear_bend, z, to.y)),
            fma(beam.shear, d.z, fma(beam.shear_bend, y, to.z)),
            fma(beam.twist, d.x2, to.twist),
            fma(beam.shear_bend_moment, d.z, fma(beam.bend, d.y1 + y, to.y1)),
            fnma(beam.shear_bend_moment, d.y, fma(beam.bend, d.z1 + z, to.z1)),
            fma(beam.shear_bend_moment, d.z, fma(beam.bend, y + d.y2, to.y2)),
            fnma(beam.shear_bend_moment, d.y, fma(beam.bend, z + d.z2, to.z2))};
  }

  // A vector turned by q^-1 = (w, 0, -y, -z): v + w t + u x t, with u = (0, -y, -z), t = 2 u x v.
  static ETHOGRAM_INLINE Vector3 rotate_back(Quaternion q, Vector3 v) {
    Lanes y2 = q.y + q.y, z2 = q.z + q.z;
    Lanes tx = fma(z2, v.y, -(y2 * v.z)), ty = -(z2 * v.x), tz = y2 * v.x;
    return {fma(q.w, tx, fnma(q.y, tz, fma(q.z, ty, v.x))), fma(q.w, ty, fnma(q.z, tx, v.y)),
            fma(q.w, tz, fma(q.y, tx, v.z))};
  }

  static ETHOGRAM_INLINE Vector3 choose(Mask mask, Vector3 a, Vector3 b) {
    return {mask ? a.x : b.x, mask ? a.y : b.y, mask ? a.z : b.z};
  }
  static ETHOGRAM_INLINE Deformation choose(Mask mask, Deformation a, Deformation b) {
    return {mask ? a.x : b.x,   mask ? a.y : b.y,   mask ? a.z : b.z,   mask ? a.y1 : b.y1,
            mask ? a.z1 : b.z1, mask ? a.x2 : b.x2, mask ? a.y2 : b.y2, mask ? a.z2 : b.z2};
  }

  // Take a way (m) by which two voxels may have come nearer from the clearance, rounded down.
  ETHOGRAM_INLINE void spend(Lanes way) {
    clearance_ -= fma(all(ROUNDING), absolute(clearance_), all(1 + ROUNDING) * way);
  }

  // Repel voxels that touch; where clearance was used up, find out how much there is now.
  void self_collisions() {
    Mask due = clearance_ <= all(0);
    if (lattice_.pairs == 0 || !any(due)) return;
    Lanes least = all(FAR_APART);
    for (int64_t pair = 0; pair < lattice_.pairs; pair++) {
      if (lattice_.pair_used && !lattice_.pair_used[pair]) continue;
      Voxel &left = voxels_[lattice_.left[pair]], &right = voxels_[lattice_.right[pair]];
      Vector3 offset = right.position - left.position;
      Lanes reach = all(TOUCH) * (left.edge + right.edge), square = dot(offset, offset);
      Mask touching = square < reach * reach;
      Lanes distance = root(square);
      Lanes gap = all(1 - ROUNDING) * distance - all(1 + ROUNDING) * absolute(reach);
      least = smaller(gap, least);
      if (any(touching)) {
        Lanes push = touching ? beam_.axial * (reach - distance) / distance : all(0);
        left.force = choose(touching, fnma(push, offset, left.force), left.force);
        right.force = choose(touching, fma(push, offset, right.force), right.force);
      }
    }
    clearance_ = due ? least : clearance_;
  }

  // The floor, then momenta, then places.
  void move() {
    Lanes most = all(0);
    for (int64_t v = 0; v < lattice_.voxels; v++) {
      Voxel& voxel = voxels_[v];
      Vector3 before = voxel.momentum, momentum = before, force = voxel.force;
      if (has_floor_) floor(voxel.position.z, voxel.edge, momentum, force);
      Vector3 way = integrated(voxel, momentum, force);
      most = larger(dot(way, way), most);
      Vector3 change = voxel.momentum - before;
      voxel.force = {change.x * per_time_, change.y * per_time_, change.z * per_time_};
    }
    spend(all(2) * root(most));
  }

  ETHOGRAM_INLINE void floor(Lanes height, Lanes edge, Vector3& momentum, Vector3& force) const {
    Lanes depth = fma(all(0.5), edge, -height), none = all(0);
    Mask inside = depth > none;
    if (!any(inside)) return;
    Lanes normal = floor_stiffness_ * depth;
    Lanes square = fma(momentum.x, momentum.x, momentum.y * momentum.y);
    Mask resting = square == none;
    Lanes sideways = root(square), friction = dynamic_friction_ * normal;
    Mask slides = friction * time_ < sideways;
    Lanes most = static_friction_ * normal;
    Mask sticks = fma(force.x, force.x, force.y * force.y) < most * most;
    Mask stops = inside & ~resting & ~slides;
    Mask held = stops | (inside & resting & sticks), braked = inside & ~resting & slides;
    Lanes brake = friction / sideways;
    force.x = held ? none : braked ? fnma(brake, momentum.x, force.x) : force.x;
    force.y = held ? none : braked ? fnma(brake, momentum.y, force.y) : force.y;
    force.z = inside ? fnma(floor_drag_, momentum.z, force.z + normal) : force.z;
    momentum.x = stops ? none : momentum.x;
    momentum.y = stops ? none : momentum.y;
  }

  // Semi-implicit Euler; returns how far the voxel went, as its position has it.
  ETHOGRAM_INLINE Vector3 integrated(Voxel& voxel, Vector3 momentum, Vector3 force) const {
    voxel.momentum = fma(time_, force, momentum);
    Vector3 position = fma(move_, voxel.momentum, voxel.position), way = position - voxel.position;
    voxel.position = position;
    Vector3 spin = fma(time_, voxel.torque, voxel.angular_momentum);
    spin = {spin.x * spin_decay_, spin.y * spin_decay_, spin.z * spin_decay_};
    voxel.angular_momentum = spin;
    // q + (0, H' / I) q dt / 2, normalised
    Lanes x = turn_ * spin.x, y = turn_ * spin.y, z = turn_ * spin.z;
    Quaternion q = voxel.orientation;
    Quaternion next = {fnma(x, q.x, fnma(y, q.y, fnma(z, q.z, q.w))),
                       fma(x, q.w, fma(y, q.z, fnma(z, q.y, q.x))),
                       fma(y, q.w, fma(z, q.x, fnma(x, q.z, q.y))),
                       fma(z, q.w, fma(x, q.y, fnma(y, q.x, q.z)))};
    Lanes square = fma(next.w, next.w, fma(next.x, next.x, fma(next.y, next.y, next.z * next.z)));
    Lanes per_length = all(1) / root(square);
    voxel.orientation = {next.w * per_length, next.x * per_length, next.y * per_length,
                         next.z * per_length};
    voxel.rotation = Matrix<Lanes>::of(voxel.orientation);
    return way;
  }

  const Lattice lattice_;
  const bool has_floor_;
  Voxel* const voxels_;
  Bond* const bonds_;
  const Beam beam_, dashpot_;
  const Lanes time_, per_time_, mass_, move_, turn_, drag_, spin_decay_;
  const Lanes floor_stiffness_, floor_drag_, static_friction_, dynamic_friction_;
  Mask first_step_, diverged_;
  Lanes clearance_;
};

// A block of arrays of which robots are the first axis, turned round: the simulation's robots last.
template <class Number>
class Tile {
  typedef State<const Number, const uint8_t, const int32_t> Before;
  typedef State<Number, uint8_t, int32_t> After;
  static constexpr int64_t WIDTH = LANES<Number>;

 public:
  // Bytes of memory that a tile needs, aligned to a vector.
  static size_t memory(const Lattice& of, int64_t steps) {
    int64_t numbers = 17 * of.voxels + 10 * of.bonds + 1 + steps * (of.voxels + 3);
    return WIDTH * (numbers * sizeof(Number) + (of.bonds + 1) + sizeof(int32_t));
  }

  Tile(const Lattice& of, int64_t steps, void* memory) : of_(of) {
    Number* next = static_cast<Number*>(memory);
    auto take = [&](int64_t rows) {
      Number* taken = next;
      next += WIDTH * rows;
      return taken;
    };
    state_.position = take(3 * of.voxels);
    state_.orientation = take(4 * of.voxels);
    state_.momentum = take(3 * of.voxels);
    state_.angular_momentum = take(3 * of.voxels);
    state_.force = take(3 * of.voxels);
    state_.edge = take(of.voxels);
    state_.strain = take(of.bonds);
    state_.deformation = take(9 * of.bonds);
    state_.clearance = take(1);
    edge_ = take(steps * of.voxels);
    gravity_ = take(steps * 3);
    state_.steps = reinterpret_cast<int32_t*>(next);
    state_.small = reinterpret_cast<uint8_t*>(state_.steps + WIDTH);
    state_.diverged = state_.small + WIDTH * of.bonds;
  }

  void run(Simulation<Number>& simulation, const Before& before, const Commands<Number>& commands,
           const After& after, Block block) {
    lanes_last(before.position, 3 * of_.voxels, block, state_.position);
    lanes_last(before.orientation, 4 * of_.voxels, block, state_.orientation);
    lanes_last(before.momentum, 3 * of_.voxels, block, state_.momentum);
    lanes_last(before.angular_momentum, 3 * of_.voxels, block, state_.angular_momentum);
    lanes_last(before.edge, of_.voxels, block, state_.edge);
    lanes_last(before.deformation, 9 * of_.bonds, block, state_.deformation);
    lanes_last(before.clearance, 1, block, state_.clearance);
    flags_last(before.small, of_.bonds, block, state_.small);
    flags_last(before.diverged, 1, block, state_.diverged);
    for (int64_t lane = 0; lane < WIDTH; lane++)
      state_.steps[lane] = before.steps[commands.count_is_shared ? 0 : block.first + at(lane, block)];

    Commands<Number> turned = commands;
    turned.count_is_shared = false;
    lanes_last(commands.edge, commands.steps * of_.voxels, block, edge_);
    turned.edge = edge_;
    if (!commands.gravity_is_shared) {
      lanes_last(commands.gravity, commands.steps * 3, block, gravity_);
      turned.gravity = gravity_;
    }
    const Before state = {state_.position, state_.orientation, state_.momentum,
                          state_.angular_momentum, state_.force, state_.edge, state_.strain,
                          state_.small, state_.deformation, state_.steps, state_.diverged,
                          state_.clearance};
    simulation.run(state, turned, state_, WIDTH, {0, WIDTH});

    lanes_first(state_.position, 3 * of_.voxels, block, after.position);
    lanes_first(state_.orientation, 4 * of_.voxels, block, after.orientation);
    lanes_first(state_.momentum, 3 * of_.voxels, block, after.momentum);
    lanes_first(state_.angular_momentum, 3 * of_.voxels, block, after.angular_momentum);
    lanes_first(state_.force, 3 * of_.voxels, block, after.force);
    lanes_first(state_.edge, of_.voxels, block, after.edge);
    lanes_first(state_.strain, of_.bonds, block, after.strain);
    lanes_first(state_.deformation, 9 * of_.bonds, block, after.deformation);
    lanes_first(state_.clearance, 1, block, after.clearance);
    flags_first(state_.small, of_.bonds, block, after.small);
    flags_first(state_.diverged, 1, block, after.diverged);
  }

 private:
  static int64_t at(int64_t lane, Block block) {
    return lane < block.count ? lane : block.count - 1;
  }

  static void flags_last(const uint8_t* from, int64_t rows, Block block, uint8_t* to) {
    from += block.first * rows;
    for (int64_t row = 0; row < rows; row++)
      for (int64_t lane = 0; lane < WIDTH; lane++)
        to[row * WIDTH + lane] = from[at(lane, block) * rows + row];
  }

  static void flags_first(const uint8_t* from, int64_t rows, Block block, uint8_t* to) {
    to += block.first * rows;
    for (int64_t lane = 0; lane < block.count; lane++)
      for (int64_t row = 0; row < rows; row++) to[lane * rows + row] = from[row * WIDTH + lane];
  }

  const Lattice of_;
  After state_;
  Number *edge_, *gravity_;
};

}  // namespace beams3d
}  // namespace ethogram
