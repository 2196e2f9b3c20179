// What is the same for all robots of one lattice: its rigid bodies, which of them springs join, and
// where its voxels' squares are at rest.
//
// Squares of a voxel are named by their place, of which bit 0 says right and bit 1 upper; so voxels
// are all alike, and none is mirrored.  A square's colour is its place, with the bits turned that
// are set in the parity of the voxel's column and row.

#pragma once

#include <math.h>
#include <stdint.h>

#include "arena.h"

namespace ethogram {
namespace lattice2d {

constexpr int COLOURS = 4, PLACES = 4;
constexpr int SIDES = 4, PAIRS = 6;  // of squares of a voxel: the sides, then the diagonals
constexpr int PAIR[PAIRS][2] = {{0, 1}, {2, 3}, {0, 2}, {1, 3}, {0, 3}, {1, 2}};
constexpr int MEMBERS = 4;           // squares of a rigid body, at most
constexpr int POINTS = 2 * MEMBERS;  // corners that can touch a surface
constexpr int MOST_LINKS = 3 * MEMBERS;

// From the centre of a voxel, or a square, towards a place.
constexpr int sign_x(int place) { return place & 1 ? 1 : -1; }
constexpr int sign_y(int place) { return place & 2 ? 1 : -1; }

// The lattice's arrays; rigid bodies are padded to as many of each colour.
template <class Number>
struct Lattice {
  int64_t voxels, bodies;
  const int32_t* cell;     // [voxel, 2]
  const uint8_t* used;     // [voxel]
  const int32_t* body;     // [colour, voxel]
  const int32_t* voxel;    // [colour, body, member]; as many as voxels: none
  const Number *vertex, *centre;     // [2, colour, body]
  const Number *squares, *inertia;   // [colour, body]
};

// Points (x, y) from left to right; no ground is no terrain.
template <class Number>
struct Terrain {
  int64_t ground_points, ceiling_points;
  const Number *ground, *ceiling;
};

// In the order in which `ethogram.physics.lattice2d.kernel.constants` gives them.
template <class Number>
struct Constants {
  Number time_step, kept;                  // share of a velocity that drag leaves in a step
  Number square, square_mass;              // a (m), m (kg)
  Number contracted, resting, expanded;    // edges of a voxel (m)
  Number spring_inertia, spring_pull;      // dt (2 zeta omega + dt omega^2), dt omega^2
  Number friction, restitution;
};

template <class Number>
class Plan {
 public:
  // Another rigid body that springs pull at; their block, and whether this body is its second one.
  struct Link {
    int32_t body, block;
    bool is_second;
  };

  struct Body {
    int32_t number;  // in the arrays, over all colours
    int32_t links, squares;
    Link link[MOST_LINKS];
    Number mass, moment, per_mass, per_moment;
    Number rest_x, rest_y;  // m
    Number offset_x[MEMBERS], offset_y[MEMBERS];  // of squares from the centre, m
    Number radius;                                // to the farthest corner, m
  };

  struct Voxel {
    int32_t number;              // in the arrays
    int32_t parity;              // of column and row
    int32_t body[PLACES];
    int32_t block[PAIRS];
    bool is_turned[PAIRS];       // whether the block's first body is the pair's second
    bool is_first[PAIRS];        // whether no voxel before has springs in the block
    Number offset_x[PLACES], offset_y[PLACES];  // of squares from their rigid bodies' centres, m
    Number apart_x[PAIRS], apart_y[PAIRS];      // of two rigid bodies' centres at rest, m
  };

  // One straight piece of the terrain.
  struct Line {
    Number from, normal_x, normal_y, reach;
  };

  Plan(const Lattice<Number>& of, const Constants<Number>& material, const Terrain<Number>& terrain,
       Arena& arena, bool measures)
      : bodies_(arena.take<Body>(COLOURS * of.bodies)),
        voxels_(arena.take<Voxel>(of.voxels)),
        lines_(arena.take<Line>(terrain.ground_points + terrain.ceiling_points)) {
    int32_t* compact = arena.take<int32_t>(COLOURS * of.bodies);
    if (measures) return;
    list_bodies(of, material, compact);
    for (int parity = 0; parity < COLOURS; parity++)
      for (int64_t v = 0; v < of.voxels; v++)
        if (of.used[v] && parity_of(of, v) == parity) add_voxel(of, material, compact, v);
    ground_lines_ = add_lines(terrain.ground, terrain.ground_points, 1, 0);
    ceiling_lines_ = add_lines(terrain.ceiling, terrain.ceiling_points, -1, ground_lines_);
  }

  // Rigid bodies by colour, and voxels by parity, both without padding.
  int64_t bodies() const { return body_count_; }
  int64_t voxels() const { return voxel_count_; }
  int64_t blocks() const { return block_count_; }
  const Body& body(int64_t b) const { return bodies_[b]; }
  const Voxel& voxel(int64_t v) const { return voxels_[v]; }

  int64_t ground_lines() const { return ground_lines_; }
  int64_t ceiling_lines() const { return ceiling_lines_; }
  const Line* ground() const { return lines_; }
  const Line* ceiling() const { return lines_ + ground_lines_; }

 private:
  static int parity_of(const Lattice<Number>& of, int64_t voxel) {
    return (of.cell[2 * voxel] & 1) | (of.cell[2 * voxel + 1] & 1) << 1;
  }

  void list_bodies(const Lattice<Number>& of, const Constants<Number>& material, int32_t* compact) {
    for (int64_t number = 0; number < COLOURS * of.bodies; number++) {
      const int32_t* members = of.voxel + number * MEMBERS;
      compact[number] = -1;
      if (members[0] >= of.voxels) continue;  // padding
      compact[number] = static_cast<int32_t>(body_count_);
      Body& body = bodies_[body_count_++];
      const Number side = material.square, edge = material.resting;
      const Number centre_x = of.centre[number], centre_y = of.centre[COLOURS * of.bodies + number];
      body.number = static_cast<int32_t>(number);
      body.links = body.squares = 0;
      body.mass = of.squares[number] * material.square_mass;
      body.moment = of.inertia[number] * material.square_mass * side * side;
      body.per_mass = 1 / body.mass, body.per_moment = 1 / body.moment;
      body.rest_x = of.vertex[number] * edge + centre_x * side;
      body.rest_y = of.vertex[COLOURS * of.bodies + number] * edge + centre_y * side;
      body.radius = 0;
      for (int member = 0; member < MEMBERS && members[member] < of.voxels; member++) {
        const int place = static_cast<int>(number / of.bodies) ^ parity_of(of, members[member]);
        Number x = offset(sign_x(place), centre_x, side), y = offset(sign_y(place), centre_y, side);
        body.offset_x[body.squares] = x, body.offset_y[body.squares++] = y;
        double corner_x = fabs(x) + side / 2, corner_y = fabs(y) + side / 2;
        double distance = sqrt(corner_x * corner_x + corner_y * corner_y);
        if (distance > body.radius) body.radius = static_cast<Number>(distance);
      }
    }
  }

  // Of a square in a place from the centre of its rigid body, along one axis.
  static Number offset(int sign, Number centre, Number side) {
    return (-Number(sign) / 2 - centre) * side;
  }

  void add_voxel(const Lattice<Number>& of, const Constants<Number>& material,
                 const int32_t* compact, int64_t number) {
    Voxel& voxel = voxels_[voxel_count_++];
    voxel.number = static_cast<int32_t>(number);
    voxel.parity = parity_of(of, number);
    for (int place = 0; place < PLACES; place++) {
      int colour = place ^ voxel.parity;
      int64_t at = colour * of.bodies + of.body[colour * of.voxels + number];
      voxel.body[place] = compact[at];
      const Number *x = of.centre + at, *y = x + COLOURS * of.bodies, side = material.square;
      voxel.offset_x[place] = offset(sign_x(place), *x, side);
      voxel.offset_y[place] = offset(sign_y(place), *y, side);
    }
    for (int pair = 0; pair < PAIRS; pair++) {
      int32_t first = voxel.body[PAIR[pair][0]], second = voxel.body[PAIR[pair][1]];
      voxel.apart_x[pair] = bodies_[second].rest_x - bodies_[first].rest_x;
      voxel.apart_y[pair] = bodies_[second].rest_y - bodies_[first].rest_y;
      join(voxel, pair, first, second);
    }
  }

  // Springs on a face that two voxels share have one block.
  void join(Voxel& voxel, int pair, int32_t first, int32_t second) {
    Body &one = bodies_[first], &other = bodies_[second];
    for (int link = 0; link < one.links; link++) {
      if (one.link[link].body != second) continue;
      voxel.block[pair] = one.link[link].block;
      voxel.is_turned[pair] = one.link[link].is_second;
      voxel.is_first[pair] = false;
      return;
    }
    int32_t block = static_cast<int32_t>(block_count_++);
    voxel.block[pair] = block;
    voxel.is_turned[pair] = false;
    voxel.is_first[pair] = true;
    one.link[one.links++] = {second, block, false};
    other.link[other.links++] = {first, block, true};
  }

  int64_t add_lines(const Number* points, int64_t count, int side, int64_t first) {
    for (int64_t line = 0; line + 1 < count; line++) {
      const Number* at = points + 2 * line;
      Number x = at[2] - at[0], y = at[3] - at[1];
      Number length = static_cast<Number>(sqrt(static_cast<double>(x * x + y * y)));
      Number normal_x = -y / length * side, normal_y = x / length * side;
      lines_[first + line] = {at[0], normal_x, normal_y, normal_x * at[0] + normal_y * at[1]};
    }
    return count > 0 ? count - 1 : 0;
  }

  Body* const bodies_;
  Voxel* const voxels_;
  Line* const lines_;
  int64_t body_count_ = 0, voxel_count_ = 0, block_count_ = 0;
  int64_t ground_lines_ = 0, ceiling_lines_ = 0;
};

}  // namespace lattice2d
}  // namespace ethogram
