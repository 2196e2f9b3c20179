// Memory of one call, taken piece by piece from one block; taking of no block measures it.

#pragma once

#include <stdint.h>

namespace ethogram {

class Arena {
 public:
  static constexpr int64_t ALIGNMENT = 64;

  // Of a block, which is aligned here; null measures.
  explicit Arena(void* block) : next_(aligned(reinterpret_cast<intptr_t>(block))), first_(next_) {}

  template <class Item>
  Item* take(int64_t count) {
    Item* taken = reinterpret_cast<Item*>(next_);
    next_ += aligned(count * static_cast<int64_t>(sizeof(Item)));
    return taken;
  }

  // Bytes of a block in which all that was taken has room.
  int64_t bytes() const { return next_ - first_ + ALIGNMENT; }

 private:
  static intptr_t aligned(intptr_t at) { return (at + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT; }

  intptr_t next_;
  const intptr_t first_;
};

}  // namespace ethogram
