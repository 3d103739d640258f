"""Names of the scalar types for the annotations of kernels."""

import numpy as np

f64 = float
i64 = int
f32 = np.float32
i32 = np.int32
u64 = np.uint64
