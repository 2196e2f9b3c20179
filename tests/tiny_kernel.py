"""A project like this one, small: a kernel that doubles numbers, which compiles in no time."""

import importlib.util
import shutil
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).parents[1]
COMPILERS = [name for name in ("c++", "g++", "clang++") if shutil.which(name)]
COPIED = (
    *("pyproject.toml", "hatch_build.py", "README.md", "LICENSE", ".gitignore"),
    *("kernels/vendored/xla/ffi/api/c_api.h", "src/ethogram/__init__.py"),
    *("src/ethogram/core/__init__.py", "src/ethogram/core/errors.py"),
    *("src/ethogram/core/kernels.py", "src/ethogram/physics/__init__.py"),
    "src/ethogram/physics/native.py",
)
SOURCE = """
#include "xla/ffi/api/c_api.h"

extern "C" __attribute__((visibility("default"))) XLA_FFI_Error* ethogram_tiny_f32(
    XLA_FFI_CallFrame* frame) {
  for (auto* found = frame->extension_start; found; found = found->next)
    if (found->type == XLA_FFI_Extension_Metadata) {
      auto* metadata = reinterpret_cast<XLA_FFI_Metadata_Extension*>(found)->metadata;
      metadata->api_version.major_version = XLA_FFI_API_MAJOR;
      metadata->api_version.minor_version = XLA_FFI_API_MINOR;
      return nullptr;
    }
  auto* from = static_cast<XLA_FFI_Buffer*>(frame->args.args[0]);
  auto* to = static_cast<XLA_FFI_Buffer*>(frame->rets.rets[0]);
  for (int64_t each = 0; each < from->dims[0]; ++each)
    static_cast<float*>(to->data)[each] = 2 * static_cast<float*>(from->data)[each];
  return nullptr;
}
"""


def write_project(folder: Path) -> Path:
    """Write it into a folder."""
    for name in COPIED:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / name)
    (folder / "kernels" / "tiny.cpp").write_text(SOURCE)
    return folder


def build_hook() -> ModuleType:
    """The module `hatch_build`, which no package holds."""
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
