/* Rays through the binary hierarchy of src/accel/bvh.rs. STACK is its depth, told by the host. */

/* In single precision and, where that leaves doubt and the device can, in double. */
uint met(float4 position, float4 direction, __global const float4 *corners, float limit, float *t, float *t_error) {
    /* Of a simplex with a corner here nothing is seen. */
    for (int i = 0; i < D; i++)
        if (all(corners[i] == position)) return OPEN;
    float single_t, single_error;
    uint found = meets_single(position, direction, corners, &single_t, &single_error);
    *t = single_t;
    *t_error = single_error;
#ifdef DOUBLE
    if (found == UNSURE) {
        double double_t, double_error;
        found = meets_double(position, direction, corners, &double_t, &double_error);
        *t = (float)double_t;
        *t_error = (float)double_error + *t * 1e-6f;
    }
#endif
    if (found != HIT || limit == INFINITY) return found;
    if (*t + *t_error < limit * (1.0f - 1e-6f)) return HIT;
    return *t - *t_error > limit * (1.0f + 1e-6f) ? OPEN : UNSURE;
}

/* One over a direction. A component that is next to nothing is taken for 1e-20: over the scene, which is about 1 wide, that
   moves the ray by less than boxes are grown by. So there is nothing here that is not a number. */
float4 inverted(float4 direction) {
    float4 size = fabs(direction);
    return 1.0f / copysign(max(size, 1e-20f), direction);
}

/* The distance at which the ray enters a box, or INFINITY where it misses it. Boxes are a little larger than what they
   hold, and distances are taken a little wider than they are, more than any rounding: no box is missed that holds a
   hit. */
float enters(__global const Node *node, float4 position, float4 inverse, float limit) {
    float4 a = (node->low - position) * inverse;
    float4 b = (node->high - position) * inverse;
    float4 nearer = min(a, b), farther = max(a, b);
#if D == 4
    float enter = max(max(nearer.x, nearer.y), max(nearer.z, nearer.w));
    float leave = min(min(farther.x, farther.y), min(farther.z, farther.w));
#else
    float enter = max(max(nearer.x, nearer.y), nearer.z);
    float leave = min(min(farther.x, farther.y), farther.z);
#endif
    enter = max(enter, 0.0f);
    leave = leave < limit ? leave : limit;
    return enter * (1.0f - 2e-6f) <= leave * (1.0f + 2e-6f) ? enter : INFINITY;
}

/* As geometry::Ray: components that would overflow the reciprocal are zero. */
float4 cleaned(float4 direction) {
    direction.x = fabs(direction.x) < 1e-30f ? 0.0f : direction.x;
    direction.y = fabs(direction.y) < 1e-30f ? 0.0f : direction.y;
    direction.z = fabs(direction.z) < 1e-30f ? 0.0f : direction.z;
    direction.w = fabs(direction.w) < 1e-30f ? 0.0f : direction.w;
    return direction;
}

/* What the simplices around the point hide. */
uint hidden_by_star(Point point, float4 direction, __global const StarCone *star) {
    uint found = OPEN;
    float size = fabs(direction.x) + fabs(direction.y) + fabs(direction.z) + fabs(direction.w);
    for (uint i = 0; i < point.star_count; i++) {
        __global const StarCone *cone = star + point.star_first + i;
        uint inside = 0, outside = 0;
        float bounds[4] = {cone->bounds.x, cone->bounds.y, cone->bounds.z, cone->bounds.w};
        for (int k = 0; k < D; k++) {
            float4 n = cone->normals[k];
            float height = n.x * direction.x + n.y * direction.y + n.z * direction.z + n.w * direction.w;
            inside += height > bounds[k] * size;
            outside += -height > bounds[k] * size;
        }
        if (inside == D) return HIT;
        if (outside == 0) found = UNSURE;
    }
    return found;
}

/* Whether anything blocks each ray of each point: for every ray HIT, OPEN or UNSURE, which the host settles. Rays come from
   `given`, or where that is not used from the points' sequences. */
__kernel void occluded(
    __global const Node *nodes, __global const float4 *corners, __global const uint *simplices, uint empty,
    __global const Point *points, __global const StarCone *star, __global const uint *matrices,
    __global const float4 *given, uint use_given, uint rays, ulong count, float limit, __global uchar *out) {
    size_t i = get_global_id(0);
    if (i >= count) return;
    Point point = points[i / rays];
    float4 direction = cleaned(use_given ? given[i] : sampled(point, point.next + (uint)(i % rays), matrices));
    uint found = hidden_by_star(point, direction, star);
    if (found == HIT || empty) {
        out[i] = (uchar)found;
        return;
    }
    float4 inverse = inverted(direction);
    uint stack[STACK];
    uint depth = 0, index = 0;
    if (enters(nodes, point.position, inverse, limit) == INFINITY) {
        out[i] = (uchar)found;
        return;
    }
    for (;;) {
        uint first = nodes[index].first, inside = nodes[index].count;
        if (inside == 0) {
            /* The nearer child first; what it holds is more likely to block. */
            float left = enters(nodes + first, point.position, inverse, limit);
            float right = enters(nodes + first + 1, point.position, inverse, limit);
            uint nearer = first + (right < left);
            if (left != INFINITY || right != INFINITY) {
                if (left != INFINITY && right != INFINITY) stack[depth++] = first + (right >= left);
                index = nearer;
                continue;
            }
        } else {
            for (uint k = first; k < first + inside; k++) {
                if (simplices[k] == point.ignored) continue;
                float t, t_error;
                uint one = met(point.position, direction, corners + D * (size_t)k, limit, &t, &t_error);
                if (one == HIT) {
                    out[i] = HIT;
                    return;
                }
                if (one == UNSURE) found = UNSURE;
            }
        }
        if (depth == 0) break;
        index = stack[--depth];
    }
    out[i] = (uchar)found;
}

/* The simplex that each ray hits first: its number, NONE if there is none, or UNSURE_SIMPLEX. If `bounded`, hits count
   only behind the ray's hit of the simplex `after`, if that is not NONE, whose distance lies between the two of `bounds`:
   nearer hits do not count, farther ones do, and what lies between makes the ray unsure. */
#define UNSURE_SIMPLEX 0xfffffffeu

__kernel void first_hit(
    __global const Node *nodes, __global const float4 *corners, __global const uint *simplices, uint empty,
    __global const float4 *origins, __global const float4 *given, uint bounded, __global const uint *after,
    __global const float2 *bounds, ulong count, __global uint *out) {
    size_t i = get_global_id(0);
    if (i >= count) return;
    float4 position = origins[i], direction = cleaned(given[i]);
    float4 inverse = inverted(direction);
    uint passed = bounded ? after[i] : NONE;
    float2 bound = bounded ? bounds[i] : (float2)(0.0f, 0.0f);
    uint best = NONE;
    float nearest = INFINITY, error = 0.0f, doubt = INFINITY;
    uint stack[STACK];
    uint depth = 0, index = 0;
    if (empty || enters(nodes, position, inverse, INFINITY) == INFINITY) {
        out[i] = NONE;
        return;
    }
    for (;;) {
        uint first = nodes[index].first, inside = nodes[index].count;
        float limit = nearest + error;
        if (inside == 0) {
            float left = enters(nodes + first, position, inverse, limit);
            float right = enters(nodes + first + 1, position, inverse, limit);
            if (left != INFINITY || right != INFINITY) {
                if (left != INFINITY && right != INFINITY) stack[depth++] = first + (right >= left);
                index = first + (right < left);
                continue;
            }
        } else {
            for (uint k = first; k < first + inside; k++) {
                if (passed != NONE && simplices[k] == passed) continue;
                float t, t_error;
                uint one = met(position, direction, corners + D * (size_t)k, INFINITY, &t, &t_error);
                if (one == OPEN) continue;
                if (passed != NONE && one == HIT) {
                    if (t + t_error < bound.x) continue;
                    if (!(t - t_error > bound.y)) one = UNSURE;
                }
                if (one == UNSURE) {
                    /* It may be hit, as near as its box. */
                    doubt = 0.0f;
                    continue;
                }
                if (best != NONE && fabs(t - nearest) <= t_error + error) doubt = min(doubt, max(t, nearest));
                if (t < nearest) {
                    best = simplices[k];
                    nearest = t;
                    error = t_error;
                }
            }
        }
        if (depth == 0) break;
        index = stack[--depth];
    }
    out[i] = doubt <= nearest + error ? UNSURE_SIMPLEX : best;
}
