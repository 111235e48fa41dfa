"""Parts of the warp's shaders, and its steps: from the source's depth to where each target pixel comes from.

Each does what the numpy function named above it does, and is written in what GLSL, Vulkan and Metal share: no function
takes a sampler, no structure is made at once. What is no number is told by its bits, since drivers may take it that
there is none.
"""

from __future__ import annotations

from ...images.bands import BAND_PIXELS
from ...images.reasons import Reason
from ...views.camera import OrthographicCamera
from ...warp.corners import CORNER_ROUNDING
from ...warp.grid import CELL_QUADS
from ...warp.quads import LARGEST_AREA_PIXELS
from ...warp.scanline import FARTHEST_PIXELS, LARGEST_NEARNESS
from ...warp.tuning import TUNING as WARP_TUNING

COMMON = f"""
#define CELL_QUADS {CELL_QUADS}
#define TEAR {float(WARP_TUNING.tear_pixels)}
#define MAX_STRETCH {float(WARP_TUNING.max_stretch)}
#define FARTHEST {float(FARTHEST_PIXELS)}
#define LARGEST {float(LARGEST_NEARNESS)}
#define AS_NEAR {float(WARP_TUNING.same_nearness_share)}
#define LARGEST_AREA {float(LARGEST_AREA_PIXELS)}
#define SKY_DEPTH {float(OrthographicCamera.SKY_DEPTH)}
#define SKY_BEGIN {float(OrthographicCamera.SKY_DEPTH * (1.0 - OrthographicCamera.SKY_ROUNDING))}
#define CORNER_ROUNDING {CORNER_ROUNDING}
#define EDGE_TOLERANCE {float(WARP_TUNING.edge_tolerance)}
#define DISOCCLUDED {Reason.DISOCCLUDED.value}u
#define OUTSIDE {Reason.OUTSIDE.value}u
#define CUT_RIGHT 1u
#define CUT_DOWN 2u
#define NO_DEPTH 4u
#define NO_NUMBER uintBitsToFloat(0x7fc00000u)
#define INFINITE uintBitsToFloat(0x7f800000u)
#define NOWHERE uintBitsToFloat(0xff800000u)
#define BROAD {WARP_TUNING.broad_pixels}
#define MOST {BAND_PIXELS}
#define HIGHEST int(0x7ffffffeu)
#define LOWEST int(0x80000000u)

bool is_nan(float value) {{ return (floatBitsToUint(value) & 0x7fffffffu) > 0x7f800000u; }}
bool is_finite(float value) {{ return (floatBitsToUint(value) & 0x7f800000u) != 0x7f800000u; }}
bool is_nowhere(float value) {{ return floatBitsToUint(value) == 0xff800000u; }}
"""

NEARNESS = """
float nearness_of(float depth) { return is_parallel != 0 ? -min(depth, SKY_DEPTH) : 1.0 / depth; }
"""

SIDES = """
// The column of the source at a place up to a width beyond its sides: repeated there, or where the picture goes on.
int column_at(int x) {
  int on = x < 0 ? x + source_size.x : x >= source_size.x ? x - source_size.x : x;
  return clamp(wraps != 0 ? on : x, 0, source_size.x - 1);
}
"""

RAY = """
// What warp._moves has coefficients of; `place` counts from the middle of the picture.
vec4 ray_at(vec2 place, float near_by) { return vec4(place, 1.0, is_parallel != 0 ? -near_by : near_by); }
// In units of its depth where rays are not parallel, so that the sky has a place.
float depth_of(vec4 ray) { return dot(move_depth, ray); }
float scale_of(vec4 ray) { return dot(move_scale, ray); }
bool is_ahead(vec4 ray) { return (is_parallel != 0 ? depth_of(ray) : scale_of(ray)) > 0.0; }
"""

MOVE = """
// Pixels to the right and down.
vec2 moved_by(vec4 ray) {
  float turned = dot(move_scale.xyw, ray.xyw);
  return (vec2(dot(move_x, ray), dot(move_y, ray)) - ray.xy * turned) / scale_of(ray);
}
"""

SPLIT = """
bool is_split(ivec2 quad) { return texelFetch(split_map, quad / CELL_QUADS, 0).x > 0.0; }
"""

TORN = """
// The quad below and to the right of lattice vertex (x, y).
bool is_torn(ivec2 quad) {
  ivec2 last = source_size - 1;
  ivec2 here = ivec2(column_at(quad.x - 1), clamp(quad.y - 1, 0, last.y));
  ivec2 next = ivec2(column_at(quad.x), clamp(quad.y, 0, last.y));
  uint a = texelFetch(cut_map, here, 0).x, b = texelFetch(cut_map, ivec2(next.x, here.y), 0).x;
  uint c = texelFetch(cut_map, ivec2(here.x, next.y), 0).x, d = texelFetch(cut_map, next, 0).x;
  bool right = (wraps != 0 || quad.x > 0) && ((a | c) & CUT_RIGHT) != 0u;
  bool down = quad.y > 0 && ((a | b) & CUT_DOWN) != 0u;
  return right || down || ((a | b | c | d) & NO_DEPTH) != 0u;
}
"""

# discontinuities.disparity_steps
CUTS = """
float disparity_at(ivec2 pixel) {
  if (wraps != 0) pixel.x = column_at(pixel.x);
  if (any(lessThan(pixel, ivec2(0))) || any(greaterThanEqual(pixel, source_size))) return NO_NUMBER;
  float depth = texelFetch(depth_map, pixel, 0).x;
  return is_nan(depth) ? NO_NUMBER : clamp(nearness_of(depth) * disparity_scale, -LARGEST, LARGEST);
}
bool steps(float before, float here, float next, float after) {
  float slope = next - here;
  if (!is_finite(here) || !is_finite(next) || !is_finite(slope)) return false;
  float found = abs(slope);
  float bend = abs(slope - (here - before));
  if (is_finite(before) && is_finite(bend)) found = min(found, bend);
  bend = abs((after - next) - slope);
  if (is_finite(after) && is_finite(bend)) found = min(found, bend);
  return found > TEAR;
}
void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (pixel.x >= source_size.x || pixel.y >= source_size.y) return;
  ivec2 right = ivec2(1, 0), down = ivec2(0, 1);
  float here = disparity_at(pixel);
  uint found = is_nan(texelFetch(depth_map, pixel, 0).x) ? NO_DEPTH : 0u;
  if (steps(disparity_at(pixel - right), here, disparity_at(pixel + right), disparity_at(pixel + 2 * right)))
    found |= CUT_RIGHT;
  if (steps(disparity_at(pixel - down), here, disparity_at(pixel + down), disparity_at(pixel + 2 * down)))
    found |= CUT_DOWN;
  imageStore(cut_image, pixel, uvec4(found));
}
"""

# scanline._corners, scanline._RowSegments._moved
CORNERS = """
float nearness_at(ivec2 vertex) {
  ivec2 pixel = ivec2(column_at(vertex.x - 1), clamp(vertex.y - 1, 0, source_size.y - 1));
  return nearness_of(texelFetch(depth_map, pixel, 0).x);
}
float end_nearness(int column, int row) {
  bool fine = is_split(ivec2(min(column, source_size.x), row)) || (column > 0 && is_split(ivec2(column - 1, row)));
  if (fine) return nearness_at(ivec2(column, row));
  int top = row / CELL_QUADS * CELL_QUADS, bottom = min(top + CELL_QUADS, source_size.y + 1);
  float down = float(row - top) / float(bottom - top);
  float first = clamp(nearness_at(ivec2(column, top)), -LARGEST, LARGEST);
  float last = clamp(nearness_at(ivec2(column, bottom)), -LARGEST, LARGEST);
  return first * (1.0 - down) + last * down;
}
// To the last digits, which the built-in one need not have. Source: Cephes, atanf.
float arc_tangent(float value) {
  float x = abs(value), angle = 0.0;
  if (x > 2.414213562373095) {
    angle = 1.5707963267948966;
    x = -1.0 / x;
  } else if (x > 0.4142135623730950) {
    angle = 0.7853981633974483;
    x = (x - 1.0) / (x + 1.0);
  }
  float z = x * x;
  angle += (((8.05374449538e-2 * z - 1.38776856032e-1) * z + 1.99777106478e-1) * z - 3.33329491539e-1) * z * x + x;
  return value < 0.0 ? -angle : angle;
}
// Nearness and shift.
vec2 end_of(int column, int row) {
  float near_by = end_nearness(column, row);
  near_by = is_nan(near_by) ? 0.0 : clamp(near_by, -LARGEST, LARGEST);
  ivec2 line = ivec2(0, row - 1);
  float shift = texelFetch(line_map, line, 0).x * near_by + texelFetch(line_map, line + ivec2(1, 0), 0).x;
  if (tangent_scale != 0.0) shift = tangent_scale * arc_tangent(shift);
  return vec2(near_by, clamp(shift, -FARTHEST, FARTHEST));
}
vec2 within_cell(int column, int row) {
  int left = column / CELL_QUADS * CELL_QUADS, right = min(left + CELL_QUADS, source_size.x + 1);
  vec2 first = end_of(left, row), last = end_of(right, row);
  return first + float(column - left) / float(right - left) * (last - first);
}
void main() {
  ivec2 corner = ivec2(gl_GlobalInvocationID.xy);
  if (corner.x >= source_size.x + 2 || corner.y >= source_size.y) return;
  int column = corner.x, row = corner.y + 1;
  bool inside = column % CELL_QUADS != 0 && column <= source_size.x && !is_split(ivec2(column, row));
  imageStore(corner_image, corner, vec4(inside ? within_cell(column, row) : end_of(column, row), 0.0, 0.0));
}
"""

# scanline._RowSegments._nearest
INTERVALS = """
// Whether nothing of it is drawn, for it is torn. Beyond the sides there is none: where rows go on there, the last
// interval is the first one once more, and knows the neighbours that the other has not.
bool is_open(int column, int row) {
  if (column < 0 || column > source_size.x || !is_split(ivec2(column, row + 1))) return false;
  return is_torn(ivec2(column, row)) && is_torn(ivec2(column, row + 1));
}
void main() {
  ivec2 interval = ivec2(gl_GlobalInvocationID.xy);
  int column = interval.x, row = interval.y;
  if (column > source_size.x || row >= source_size.y || is_open(column, row)) return;
  float left = texelFetch(corner_map, interval, 0).y, right = texelFetch(corner_map, interval + ivec2(1, 0), 0).y;
  int first = column - 1 + int(ceil(is_open(column - 1, row) ? left - EDGE_TOLERANCE : left));
  int end = column + (is_open(column + 1, row) ? int(floor(right + EDGE_TOLERANCE)) + 1 : int(ceil(right)));
  // What is overstretched or seen from its other side has nothing to show, but hides what is behind it.
  bool shown = first < end && 1.0 + right - left < MAX_STRETCH;
  // Once, or in each of the turns that the picture may show.
  for (int turn = -wraps; turn <= wraps; turn++) {
    int by = turn * source_size.x;
    int low = max(min(first, end) + by, 0), high = min(max(first, end) + by, target_size.x);
    int key = !shown && high - low > BROAD ? HIGHEST : 2 * (key_way.x + key_way.y * (column + by)) + (shown ? 1 : 0);
    for (int x = low; x < high; x++) imageAtomicMax(owner_image, ivec2(x, row), key);
  }
}
"""

# scanline._RowSegments.warp
PLACES = """
void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (pixel.x >= target_size.x || pixel.y >= target_size.y) return;
  int key = texelFetch(owner_map, pixel, 0).x;
  float x = NO_NUMBER, y = NO_NUMBER, near_by = NOWHERE;
  if (key >= 0 && (key & 1) != 0) {
    int interval = (key / 2 - key_way.x) * key_way.y, column = wraps != 0 ? column_at(interval) : interval;
    vec2 left = texelFetch(corner_map, ivec2(column, pixel.y), 0).xy;
    vec2 right = texelFetch(corner_map, ivec2(column + 1, pixel.y), 0).xy;
    float wide = 1.0 + right.y - left.y;
    float along = wide > 0.0 ? clamp((float(pixel.x + 1 - interval) - left.y) / wide, 0.0, 1.0) : 0.0;
    x = (float(interval) - 0.5) + along;
    if (wraps != 0) x -= float(source_size.x) * floor(x / float(source_size.x));
    y = float(pixel.y) + 0.5;
    near_by = left.x + along * (right.x - left.x);
  }
  imageStore(x_image, pixel, vec4(x));
  imageStore(y_image, pixel, vec4(y));
  imageStore(near_image, pixel, vec4(near_by));
}
"""

# corners.project_corners; of panoramas numpy projects the corners
VERTICES = """
void main() {
  ivec2 vertex = ivec2(gl_GlobalInvocationID.xy);
  if (vertex.x >= source_size.x + 2 || vertex.y >= source_size.y + 2) return;
  float depth = texelFetch(depth_map, clamp(vertex - 1, ivec2(0), source_size - 1), 0).x;
  vec2 position = vec2(vertex) - 0.5;
  vec4 ray = ray_at(position - 0.5 * vec2(source_size), nearness_of(depth));
  float near_by = is_parallel != 0 ? -min(depth_of(ray), SKY_DEPTH) : ray.w / scale_of(ray);
  bool known = !is_nan(depth) && is_ahead(ray) && is_finite(near_by);
  // Quads that share a corner have it in one place, from wherever they count: whole pixels are added without rounding.
  vec2 moved = floor(moved_by(ray) / CORNER_ROUNDING + 0.5) * CORNER_ROUNDING;
  imageStore(vertex_image, vertex, known ? vec4(moved, near_by, 1.0) : vec4(0.0));
}
"""

# quads._triangles, and what quads._Surface._fill makes of them
QUAD = """
// Where a corner lands, counted from the place of the quad's first corner in the source: small numbers are exact.
vec4 corner_at(ivec2 vertex, ivec2 start) {
  return texelFetch(vertex_map, vertex, 0) + vec4(vec2(vertex - start), 0.0, 0.0);
}
// quads._all_around: corners beside the first one, where the picture's angles begin anew.
vec4 beside(vec4 corner, float first) {
  if (period > 0.0) corner.x -= period * floor((corner.x - first) / period + 0.5);
  return corner;
}
struct Triangle { vec3 origin; vec3 along_u; vec3 along_v; float determinant; bool drawn; bool hides; };
Triangle triangle_of(vec3 origin, vec3 end_u, vec3 end_v, float area) {
  vec3 u = end_u - origin, v = end_v - origin;
  float determinant = u.x * v.y - u.y * v.x;
  Triangle result;
  result.origin = origin;
  result.along_u = u;
  result.along_v = v;
  result.determinant = determinant;
  result.drawn = abs(determinant) > 1e-9 && abs(determinant) < LARGEST_AREA;
  result.hides = determinant < 0.0 || determinant >= MAX_STRETCH * area;
  return result;
}
vec2 within(Triangle by, vec2 centre) {
  vec2 d = centre - by.origin.xy;
  return vec2(d.x * by.along_v.y - d.y * by.along_v.x, by.along_u.x * d.y - by.along_u.y * d.x) / by.determinant;
}
bool is_in_upper(Triangle upper, vec2 uv) { return upper.drawn && uv.x + uv.y <= 1.0; }
float nearness_in(Triangle by, vec2 uv) { return by.origin.z + uv.x * by.along_u.z + uv.y * by.along_v.z; }
// Fine quads before coarse ones, each row by row; of two that are as near, the one with the lower number has the pixel.
// numpy draws the fine ones cell by cell: where two of them meet, either place is within the tolerance of the other.
int number_of(ivec2 start, bool fine) {
  ivec2 size = source_size + 1;
  return start.y * size.x + start.x + (fine ? 0 : size.x * size.y);
}
"""

# quads._Surface._fill; drawn twice, the second time to settle which of the nearest it is. By one and the same shader:
# two might round the same nearness differently.
DRAW = """
int ordered(float value) {
  int bits = floatBitsToInt(value);
  return bits < 0 ? bits ^ 0x7fffffff : bits;
}
// Or beside what is left out as in quads._left_out, for a corner behind the target's camera, or beside a coarse cell.
bool is_beside_tear(ivec2 quad) {
  ivec2 size = cell_count * CELL_QUADS;
  for (int y = max(quad.y - 1, 0); y <= min(quad.y + 1, size.y - 1); y++)
    for (int x = max(quad.x - 1, 0); x <= min(quad.x + 1, size.x - 1); x++)
      if (x > source_size.x || y > source_size.y || !is_split(ivec2(x, y)) || is_torn(ivec2(x, y))) return true;
  for (int y = max(quad.y - 1, 0); y <= min(quad.y + 2, source_size.y + 1); y++)
    for (int x = max(quad.x - 1, 0); x <= min(quad.x + 2, source_size.x + 1); x++)
      if (texelFetch(vertex_map, ivec2(x, y), 0).w < 0.5) return true;
  return false;
}
void draw_at(vec3 a, vec3 b, vec3 c, vec3 d, ivec2 start, vec2 size, float margin) {
  vec2 low = min(min(a.xy, b.xy), min(c.xy, d.xy)) - margin, high = max(max(a.xy, b.xy), max(c.xy, d.xy)) + margin;
  vec2 none = -vec2(start), whole = vec2(target_size - start);
  ivec2 first = start + ivec2(clamp(ceil(low - 1.0), none, whole));
  ivec2 stop = start + ivec2(clamp(ceil(high - 1.0), none, whole));
  if (any(equal(first, stop))) return;
  Triangle upper = triangle_of(a, b, c, size.x * size.y), lower = triangle_of(d, c, b, size.x * size.y);
  if (!upper.drawn && !lower.drawn) return;
  if ((stop.x - first.x) * (stop.y - first.y) > MOST) {
    imageAtomicMax(broad_image, ivec2(0), 1u);
    return;
  }
  bool fine = quad_span == 1;
  for (int y = first.y; y < stop.y; y++) {
    for (int x = first.x; x < stop.x; x++) {
      vec2 centre = vec2(ivec2(x, y) - start) + 1.0;
      vec2 uv = within(upper, centre);
      bool in_upper = is_in_upper(upper, uv);
      if (!in_upper && !lower.drawn) continue;
      vec2 turned = within(lower, centre);
      float near_by = in_upper ? nearness_in(upper, uv) : nearness_in(lower, turned);
      float least = in_upper ? min(uv.x, uv.y) : min(min(turned.x, turned.y), 1.0 - turned.x - turned.y);
      if (!(least >= -EDGE_TOLERANCE) || !is_finite(near_by)) continue;
      int key = ordered(fine ? near_by : near_by - AS_NEAR * abs(near_by));
      int stands = imageAtomicMax(owner_image, ivec2(x, y), key);
      if (to_settle != 0 && stands == key) imageAtomicMax(drawn_image, ivec2(x, y), -number_of(start, fine));
    }
  }
}
void main() {
  ivec2 start = ivec2(gl_GlobalInvocationID.xy) * quad_span;
  if (start.x > source_size.x || start.y > source_size.y) return;
  bool fine = quad_span == 1;
  if (is_split(start) != fine) return;
  ivec2 end = min(start + quad_span, source_size + 1);
  vec4 a = corner_at(start, start), b = beside(corner_at(ivec2(end.x, start.y), start), a.x);
  vec4 c = beside(corner_at(ivec2(start.x, end.y), start), a.x), d = beside(corner_at(end, start), a.x);
  if (min(min(a.w, b.w), min(c.w, d.w)) < 0.5 || (fine && is_torn(start))) return;
  // It is behind the camera, or the eye stands within.
  if (max(max(a.x, b.x), max(c.x, d.x)) - min(min(a.x, b.x), min(c.x, d.x)) >= widest) return;
  float margin = !fine || is_beside_tear(start) ? EDGE_TOLERANCE : 0.0;
  int turns = period > 0.0 ? 1 : 0;
  for (int turn = -turns; turn <= turns; turn++) {
    vec3 by = vec3(float(turn) * period, 0.0, 0.0);
    draw_at(a.xyz + by, b.xyz + by, c.xyz + by, d.xyz + by, start, vec2(end - start), margin);
  }
}
"""

# quads._Surface.result
SETTLED = """
// Place and nearness.
vec3 point_in(ivec2 start, bool fine, ivec2 pixel) {
  vec2 centre = vec2(pixel - start) + 1.0;
  ivec2 end = fine ? start + 1 : min(start + CELL_QUADS, source_size + 1);
  vec4 a = corner_at(start, start), b = beside(corner_at(ivec2(end.x, start.y), start), a.x);
  vec4 c = beside(corner_at(ivec2(start.x, end.y), start), a.x), d = beside(corner_at(end, start), a.x);
  float middle = 0.5 * (min(min(a.x, b.x), min(c.x, d.x)) + max(max(a.x, b.x), max(c.x, d.x)));
  vec3 by = vec3(period > 0.0 ? period * floor((centre.x - middle) / period + 0.5) : 0.0, 0.0, 0.0);
  vec2 size = vec2(end - start);
  Triangle upper = triangle_of(a.xyz + by, b.xyz + by, c.xyz + by, size.x * size.y);
  Triangle lower = triangle_of(d.xyz + by, c.xyz + by, b.xyz + by, size.x * size.y);
  vec2 uv = within(upper, centre);
  // It was drawn: by one of the two, whatever rounding says of the diagonal here.
  bool in_upper = is_in_upper(upper, uv) || !lower.drawn;
  if (in_upper ? upper.hides : lower.hides) return vec3(NO_NUMBER, NO_NUMBER, NOWHERE);
  vec2 turned = within(lower, centre);
  vec2 place = vec2(start) - 0.5 + (in_upper ? uv : 1.0 - turned) * size;
  if (wraps != 0) place.x -= float(source_size.x) * floor(place.x / float(source_size.x));
  return vec3(place, in_upper ? nearness_in(upper, uv) : nearness_in(lower, turned));
}
void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (pixel.x >= target_size.x || pixel.y >= target_size.y) return;
  int number = texelFetch(drawn_map, pixel, 0).x;
  vec3 point = vec3(NO_NUMBER, NO_NUMBER, NOWHERE);
  if (number != LOWEST) {
    int first_coarse = number_of(ivec2(0), false), of_its_kind = -number;
    bool fine = of_its_kind < first_coarse;
    if (!fine) of_its_kind -= first_coarse;
    int width = source_size.x + 1;
    point = point_in(ivec2(of_its_kind % width, of_its_kind / width), fine, pixel);
  }
  imageStore(x_image, pixel, vec4(point.x));
  imageStore(y_image, pixel, vec4(point.y));
  imageStore(near_image, pixel, vec4(point.z));
}
"""
