// Arguments and results of a handler, checked against the C interface of XLA's foreign functions.

#pragma once

#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "xla/ffi/api/c_api.h"

namespace ethogram {

template <class Number>
struct TypeOf;
template <>
struct TypeOf<float> {
  static constexpr XLA_FFI_DataType value = XLA_FFI_DataType_F32;
  static constexpr const char* name = "f32";
};
template <>
struct TypeOf<double> {
  static constexpr XLA_FFI_DataType value = XLA_FFI_DataType_F64;
  static constexpr const char* name = "f64";
};
template <>
struct TypeOf<int32_t> {
  static constexpr XLA_FFI_DataType value = XLA_FFI_DataType_S32;
  static constexpr const char* name = "s32";
};
template <>
struct TypeOf<uint8_t> {
  static constexpr XLA_FFI_DataType value = XLA_FFI_DataType_PRED;
  static constexpr const char* name = "pred";
};

// One call of a handler.  Arguments are taken in their order, then results in theirs; the first that
// is not what it should be is named by `error`, and what is taken after that is null.
//
// An array has, one after the other: the axis of bodies, if the call has one; axes of its own; and
// any number of axes of robots, which count as one, of as many lanes as there are robots.  Or robots
// come first, before the array's own axes.
class Call {
 public:
  explicit Call(XLA_FFI_CallFrame* frame) : frame_(frame), has_bodies_(flag("bodies")), robots_first_(flag("robots_first")) {}

  // Whether XLA asks what the handler is instead of calling it; it is then answered.
  static bool asked_for_metadata(XLA_FFI_CallFrame* frame) {
    for (XLA_FFI_Extension_Base* each = frame->extension_start; each; each = each->next) {
      if (each->type != XLA_FFI_Extension_Metadata) continue;
      XLA_FFI_Metadata* about = reinterpret_cast<XLA_FFI_Metadata_Extension*>(each)->metadata;
      about->api_version.major_version = XLA_FFI_API_MAJOR;
      about->api_version.minor_version = XLA_FFI_API_MINOR;
      about->traits = 0;
      about->state_type_id = XLA_FFI_UNKNOWN_TYPE_ID;
      return true;
    }
    return false;
  }

  // The next argument.  Sizes of its own axes, and lanes, are numbers, or variables that are set if
  // they are below 0; without lanes it is the same for all robots.
  template <class Number, class Lanes, class... Sizes>
  const Number* argument(const char* name, Lanes& lanes, Sizes&... own) {
    if (failed_) return nullptr;
    if (arguments_ >= frame_->args.size) return refuse("there is no argument %s", name), nullptr;
    Size sizes[] = {Size(lanes), Size(own)...};
    int64_t place = arguments_++;
    return data<Number>("argument", name, frame_->args.args[place], sizes, sizeof...(own));
  }

  // The next result.
  template <class Number, class Lanes, class... Sizes>
  Number* result(const char* name, Lanes& lanes, Sizes&... own) {
    if (failed_) return nullptr;
    if (results_ >= frame_->rets.size) return refuse("there is no result %s", name), nullptr;
    Size sizes[] = {Size(lanes), Size(own)...};
    int64_t place = results_++;
    return data<Number>("result", name, frame_->rets.rets[place], sizes, sizeof...(own));
  }

  // How many bodies there are, known when anything was taken.
  int64_t bodies() const { return bodies_; }

  bool flag(const char* name) {
    const void* value = attribute(name, XLA_FFI_DataType_PRED, "a truth value");
    return value && *static_cast<const uint8_t*>(value) != 0;
  }

  int64_t integer(const char* name) {
    const void* value = attribute(name, XLA_FFI_DataType_S64, "an integer of 64 bits");
    return value ? *static_cast<const int64_t*>(value) : 0;
  }

  void refuse(const char* format, ...) __attribute__((format(printf, 2, 3))) {
    if (failed_) return;
    failed_ = true;
    va_list values;
    va_start(values, format);
    vsnprintf(message_, sizeof message_, format, values);
    va_end(values);
  }

  bool robots_first() const { return robots_first_; }

  bool failed() const { return failed_; }

  // After everything is taken: what was refused, or null.
  XLA_FFI_Error* error(XLA_FFI_Error_Code code = XLA_FFI_Error_Code_INVALID_ARGUMENT) {
    if (!failed_ && (arguments_ != frame_->args.size || results_ != frame_->rets.size))
      refuse("there are %lld arguments and %lld results; it takes %lld and gives %lld",
             (long long)frame_->args.size, (long long)frame_->rets.size, (long long)arguments_,
             (long long)results_);
    if (!failed_) return nullptr;
    XLA_FFI_Error_Create_Args create = {};
    create.struct_size = XLA_FFI_Error_Create_Args_STRUCT_SIZE;
    create.message = message_;
    create.errc = code;
    return frame_->api->XLA_FFI_Error_Create(&create);
  }

 private:
  class Size {
   public:
    explicit Size(int64_t& variable) : variable_(&variable), value_(variable) {}
    explicit Size(const int64_t& value) : variable_(nullptr), value_(value) {}

    // What it should be; one that may be anything becomes what is found.
    int64_t expected(int64_t found) const {
      if (!variable_) return value_;
      if (*variable_ < 0) *variable_ = found;
      return *variable_;
    }

   private:
    int64_t* variable_;
    int64_t value_;
  };

  const void* attribute(const char* name, XLA_FFI_DataType type, const char* what) {
    for (int64_t i = 0; !failed_ && i < frame_->attrs.size; i++) {
      const XLA_FFI_ByteSpan* found = frame_->attrs.names[i];
      if (found->len != strlen(name) || memcmp(found->ptr, name, found->len) != 0) continue;
      const XLA_FFI_Scalar* scalar = static_cast<const XLA_FFI_Scalar*>(frame_->attrs.attrs[i]);
      if (frame_->attrs.types[i] != XLA_FFI_AttrType_SCALAR || scalar->dtype != type)
        return refuse("attribute %s: it should be %s", name, what), nullptr;
      return scalar->value;
    }
    return refuse("there is no attribute %s", name), nullptr;
  }

  template <class Number>
  Number* data(const char* kind, const char* name, void* any, const Size* sizes, int64_t own) {
    const XLA_FFI_Buffer* buffer = static_cast<const XLA_FFI_Buffer*>(any);
    if (buffer->dtype != TypeOf<Number>::value)
      return refuse("%s %s: it should be of type %s", kind, name, TypeOf<Number>::name), nullptr;
    int64_t axis = 0, axes = own + has_bodies_, lanes = 1;
    if (buffer->rank < axes)
      return refuse("%s %s: it has %lld axes; it should have at least %lld", kind, name,
                    (long long)buffer->rank, (long long)axes),
             nullptr;
    if (has_bodies_) fits(kind, name, "bodies", buffer->dims[axis++], Size(bodies_));
    int64_t first_own = robots_first_ ? buffer->rank - own : axis;
    for (; axis < buffer->rank; axis++) {
      int64_t place = axis - first_own;
      if (place < 0 || place >= own)
        lanes *= buffer->dims[axis];
      else
        fits(kind, name, "entries along an axis", buffer->dims[axis], sizes[1 + place]);
    }
    fits(kind, name, "robots", lanes, sizes[0]);
    return failed_ ? nullptr : static_cast<Number*>(buffer->data);
  }

  void fits(const char* kind, const char* name, const char* what, int64_t found, Size size) {
    int64_t expected = size.expected(found);
    if (found != expected)
      refuse("%s %s: it has %lld %s; it should have %lld", kind, name, (long long)found, what,
             (long long)expected);
  }

  XLA_FFI_CallFrame* frame_;
  int64_t arguments_ = 0, results_ = 0;
  bool failed_ = false;
  char message_[200];
  const bool has_bodies_, robots_first_;
  int64_t bodies_ = has_bodies_ ? -1 : 1;
};

}  // namespace ethogram
