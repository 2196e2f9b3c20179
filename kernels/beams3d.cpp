// A stand-in: hands on the first bytes of its argument.
#include <string.h>

#include "xla/ffi/api/c_api.h"

static XLA_FFI_Error* run(XLA_FFI_CallFrame* frame, size_t width) {
  for (auto* found = frame->extension_start; found; found = found->next)
    if (found->type == XLA_FFI_Extension_Metadata) {
      auto* metadata = reinterpret_cast<XLA_FFI_Metadata_Extension*>(found)->metadata;
      metadata->api_version.major_version = XLA_FFI_API_MAJOR;
      metadata->api_version.minor_version = XLA_FFI_API_MINOR;
      return nullptr;
    }
  auto* from = static_cast<XLA_FFI_Buffer*>(frame->args.args[0]);
  auto* to = static_cast<XLA_FFI_Buffer*>(frame->rets.rets[0]);
  size_t size = width;
  for (int64_t axis = 0; axis < from->rank; ++axis) size *= from->dims[axis];
  memcpy(to->data, from->data, size);
  return nullptr;
}

extern "C" __attribute__((visibility("default"))) XLA_FFI_Error* ethogram_beams3d_f32(
    XLA_FFI_CallFrame* frame) {
  return run(frame, 4);
}

extern "C" __attribute__((visibility("default"))) XLA_FFI_Error* ethogram_beams3d_f64(
    XLA_FFI_CallFrame* frame) {
  return run(frame, 8);
}
