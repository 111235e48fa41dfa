"""The steps after the warp: what is empty and why, and what of the passes each target pixel shows.

Written as those in `warp_source` are, with its parts.
"""

from __future__ import annotations

# empty._behind_empty; a row is one invocation's, there and back, whatever is empty in it.
NEIGHBOURS = """
void main() {
  int row = int(gl_GlobalInvocationID.x);
  if (row >= target_size.y) return;
  float last = NO_NUMBER;
  for (int x = 0; x < target_size.x; x++) {
    float value = texelFetch(near_map, ivec2(x, row), 0).x;
    if (!is_nowhere(value)) last = value;
    else imageStore(before_image, ivec2(x, row), vec4(last));
  }
  last = NO_NUMBER;
  for (int x = target_size.x - 1; x >= 0; x--) {
    float value = texelFetch(near_map, ivec2(x, row), 0).x;
    if (!is_nowhere(value)) last = value;
    else imageStore(after_image, ivec2(x, row), vec4(last));
  }
}
"""

# empty.empty_reasons; here the target is what points come from.
FLAGS = """
uint flags_of_empty(ivec2 pixel) {
  float before = texelFetch(before_map, pixel, 0).x, after = texelFetch(after_map, pixel, 0).x;
  float behind = is_nan(before) ? after : is_nan(after) ? before : min(before, after);
  if (!is_finite(behind)) return OUTSIDE;
  vec2 position = vec2(pixel) + 0.5;
  vec4 ray = ray_at(position - 0.5 * vec2(target_size), behind);
  if (!is_ahead(ray)) return OUTSIDE;
  vec2 place = position + moved_by(ray);
  bool inside = all(greaterThan(place, vec2(0.0))) && all(lessThan(place, vec2(source_size)));
  return inside ? DISOCCLUDED : OUTSIDE;
}
void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (pixel.x >= target_size.x || pixel.y >= target_size.y) return;
  vec2 place = vec2(texelFetch(x_map, pixel, 0).x, texelFetch(y_map, pixel, 0).x);
  uint found = 0u;
  if (is_nan(place.x)) found = flags_of_empty(pixel);
  else if (any(lessThan(place, vec2(0.0))) || any(greaterThan(place, vec2(source_size)))) found = OUTSIDE;
  imageStore(flag_image, pixel, uvec4(found));
}
"""

# lookup._linear, _cubic, _nearest and _lookup_band. TAPS: how many pixels along each axis; LANES: how
# many channels at once.
BLENDED = """
#if TAPS == 1
#  define CENTRE 0.0
#  define REACH 0
#elif TAPS == 2
#  define CENTRE 0.5
#  define REACH 0
#else
#  define CENTRE 0.5
#  define REACH 1
#endif
vec4 weights_at(float t) {
#if TAPS == 1
  return vec4(1.0);
#elif TAPS == 2
  return vec4(1.0 - t, t, 0.0, 0.0);
#else
  float t2 = t * t, t3 = t * t * t;
  return vec4(-0.5 * t3 + t2 - 0.5 * t, 1.5 * t3 - 2.5 * t2 + 1.0, -1.5 * t3 + 2.0 * t2 + 0.5 * t, 0.5 * t3 - 0.5 * t2);
#endif
}
VALUE blended(vec2 place) {
  vec2 shifted = place - CENTRE, start = floor(shifted);
  vec4 across = weights_at(shifted.x - start.x), along = weights_at(shifted.y - start.y);
  VALUE total = VALUE(0.0), least = VALUE(3.4e38), most = VALUE(-3.4e38);
  for (int row = 0; row < TAPS; row++) {
    for (int column = 0; column < TAPS; column++) {
      float weight = across[column] * along[row];
      if (weight != 0.0) {
        ivec2 pixel = ivec2(start) + ivec2(column, row) - REACH;
        VALUE value = value_at(ivec2(column_at(pixel.x), clamp(pixel.y, 0, source_size.y - 1)));
        total += value * weight;
        least = min(least, value);
        most = max(most, value);
      }
    }
  }
  return TAPS == 4 ? clamp(total, least, most) : total;
}
"""

# A picture is folded where its rows are wider than a texture: `fold` texels stand in a line, more lines in a row.
LOOKUP = """
ivec2 folded(ivec2 pixel, ivec2 fold) {
  ivec2 texel = ivec2(pixel.x * texel_count + int(gl_GlobalInvocationID.z), pixel.y);
  if (fold.y == 1) return texel;
  int line = texel.x / fold.x;
  return ivec2(texel.x - line * fold.x, texel.y * fold.y + line);
}
VALUE value_at(ivec2 pixel) {
#if LANES == 4
  return texelFetch(picture_map, folded(pixel, source_fold), 0);
#else
  return texelFetch(picture_map, folded(pixel, source_fold), 0).x;
#endif
}
"""
LOOKED_UP = """
void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (pixel.x >= target_size.x || pixel.y >= target_size.y) return;
  vec2 place = vec2(texelFetch(x_map, pixel, 0).x, texelFetch(y_map, pixel, 0).x);
  VALUE value = VALUE(0.0);
  if (!is_nan(place.x)) value = blended(place);
#if LANES == 4
  imageStore(result4_image, folded(pixel, target_fold), value);
#else
  imageStore(result_image, folded(pixel, target_fold), vec4(value));
#endif
}
"""

# composite.target_depth
NEARNESS_THERE = """
float value_at(ivec2 pixel) {
  float depth = texelFetch(depth_map, pixel, 0).x;
  return is_nan(depth) ? 0.0 : clamp(nearness_of(depth), -3.4e38, 3.4e38);
}
"""
TARGET_DEPTH = """
float target_depth(vec2 place) {
  float near_by = blended(place);
  if (is_parallel != 0 ? near_by <= -SKY_BEGIN : near_by == 0.0) return INFINITE;
  vec4 ray = ray_at(place - 0.5 * vec2(source_size), near_by);
  if (!is_ahead(ray)) return NO_NUMBER;
  return is_parallel != 0 ? depth_of(ray) : scale_of(ray) / near_by;
}
void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (pixel.x >= target_size.x || pixel.y >= target_size.y) return;
  vec2 place = vec2(texelFetch(x_map, pixel, 0).x, texelFetch(y_map, pixel, 0).x);
  imageStore(result_image, pixel, vec4(is_nan(place.x) ? INFINITE : target_depth(place)));
}
"""
