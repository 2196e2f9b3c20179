// Avalanches: how far, and for how long, the pulse of one voxel is felt by the others.
//
// Lanes are drives; a lane of which the run has stopped takes the next one.  Those voxels come
// first that have the fewest others about them: runs at corners are the longest by far, and a long
// one that begins late keeps all lanes waiting.

#pragma once

#include "lattice2d.h"

namespace ethogram {
namespace lattice2d {

constexpr int64_t CONTRACTED_AFTER = 1, EXPANDED_AFTER = 13, RELEASED_AFTER = 25;  // steps
constexpr int64_t NONE = -1;

template <class Number>
class Avalanches {
  typedef ethogram::Vector<Number> Lanes;
  typedef ethogram::Mask<Number> Mask;
  static constexpr int WIDTH = LANES<Number>;

 public:
  Avalanches(Simulation<Number>& simulation, int64_t voxels, Arena& arena)
      : simulation_(simulation),
        area_(arena.take<Lanes>(voxels)),
        touched_(arena.take<Mask>(voxels)),
        order_(arena.take<int32_t>(voxels)) {}

  // Sizes and durations by the array's voxels; what is padding keeps what was there.
  void run(Number threshold, int64_t most_steps, int32_t* sizes, int32_t* durations) {
    put_in_order();
    int64_t voxels = simulation_.plan().voxels(), next = 0, running = 0;
    for (int lane = 0; lane < WIDTH; lane++) drive_[lane] = NONE;
    Mask fresh = {};
    auto take_next = [&](int lane) {
      bool is_left = next < voxels;
      drive_[lane] = is_left ? order_[next++] : NONE;
      step_[lane] = duration_[lane] = 0;
      fresh[lane] = -1;
      running += is_left;
    };
    for (int lane = 0; lane < WIDTH; lane++) take_next(lane);
    while (running > 0) {
      if (any(fresh)) begin(fresh);
      fresh = Mask{};
      command();
      simulation_.step();
      Mask active = look(threshold);
      for (int lane = 0; lane < WIDTH; lane++) {
        if (drive_[lane] == NONE) continue;
        bool is_active = active[lane] != 0;
        duration_[lane] += is_active;
        if ((is_active || step_[lane] == 1) && step_[lane] < most_steps) continue;
        int64_t number = simulation_.plan().voxel(drive_[lane]).number;
        sizes[number] = size(lane), durations[number] = duration_[lane];
        running--;
        take_next(lane);
      }
    }
  }

 private:
  void put_in_order() {
    const Plan<Number>& plan = simulation_.plan();
    int64_t found = 0;
    for (int squares = PLACES; squares <= PLACES * MEMBERS; squares++)
      for (int64_t v = 0; v < plan.voxels(); v++) {
        int of_voxel = 0;  // squares of its rigid bodies
        for (int32_t body : plan.voxel(v).body) of_voxel += plan.body(body).squares;
        if (of_voxel == squares) order_[found++] = static_cast<int32_t>(v);
      }
  }

  // Bodies that nothing has happened to, in some lanes.
  void begin(Mask fresh) {
    simulation_.rest(fresh);
    for (int64_t v = 0; v < simulation_.plan().voxels(); v++) {
      touched_[v] = touched_[v] & ~fresh;
      simulation_.control(v) = fresh ? broadcast(Number(0)) : simulation_.control(v);
    }
  }

  // The next step's control of the voxel that is driven.
  void command() {
    for (int lane = 0; lane < WIDTH; lane++) {
      if (drive_[lane] == NONE) continue;
      int64_t step = step_[lane]++;
      simulation_.control(drive_[lane])[lane] = static_cast<Number>(
          step < CONTRACTED_AFTER || step >= RELEASED_AFTER ? 0 : step < EXPANDED_AFTER ? 1 : -1);
    }
  }

  // Lanes in which a voxel is active: its area changed by more than a threshold in this step, which
  // is not the first.
  Mask look(Number threshold) {
    Mask later, any_active = {};
    for (int lane = 0; lane < WIDTH; lane++) later[lane] = step_[lane] > 1 ? -1 : 0;
    for (int64_t v = 0; v < simulation_.plan().voxels(); v++) {
      Lanes area = simulation_.area_ratio(v);
      Mask active = later & (absolute(area - area_[v]) > broadcast(threshold));
      area_[v] = area;
      touched_[v] |= active;
      any_active |= active;
    }
    return any_active;
  }

  int32_t size(int lane) const {
    int32_t found = 0;
    for (int64_t v = 0; v < simulation_.plan().voxels(); v++) found += touched_[v][lane] != 0;
    return found;
  }

  Simulation<Number>& simulation_;
  Lanes* const area_;    // ratio after the last step
  Mask* const touched_;  // voxels that were active in this run
  int32_t* const order_;
  int64_t drive_[WIDTH], step_[WIDTH];
  int32_t duration_[WIDTH];
};

}  // namespace lattice2d
}  // namespace ethogram
