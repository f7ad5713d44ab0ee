/* Rays through the hierarchy that src/trace/opencl/wide.rs makes: nodes of eight boxes. The host tells DEPTH, how many nodes
   lie on its longest way from the root to a leaf. */

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

/* Which of a node's boxes the ray enters before `limit`, a bit each, and the distances at which it does. Boxes are a little
   larger than what they hold, and distances are taken a little wider than they are, more than any rounding: no box is missed
   that holds a hit. Products of a byte and a power of two are exact, so the host knows the boxes to the bit. */
uint boxes(__global const Node *node, float4 position, float4 inverse, float limit, float8 *distances) {
    float8 enter = (float8)(0.0f), leave = (float8)(limit);
    float4 origin = node->origin;
    const float from[4] = {origin.x, origin.y, origin.z, origin.w};
    const float p[4] = {position.x, position.y, position.z, position.w};
    const float reciprocal[4] = {inverse.x, inverse.y, inverse.z, inverse.w};
    uint exponents = node->exponents;
    for (int axis = 0; axis < D; axis++) {
        float step = as_float((exponents >> 8 * axis & 0xffu) << 23);
        float8 low = from[axis] + convert_float8(as_uchar8(node->low[axis])) * step;
        float8 high = from[axis] + convert_float8(as_uchar8(node->high[axis])) * step;
        float8 a = (low - p[axis]) * reciprocal[axis], b = (high - p[axis]) * reciprocal[axis];
        enter = max(enter, min(a, b));
        leave = min(leave, max(a, b));
    }
    *distances = enter;
    int8 met = (enter * (1.0f - 2e-6f) <= leave * (1.0f + 2e-6f)) & (int8)(1, 2, 4, 8, 16, 32, 64, 128);
    int4 half_ = met.lo | met.hi;
    int2 quarter = half_.lo | half_.hi;
    return (uint)(quarter.x | quarter.y) & ((1u << node->filled) - 1u);
}

/* The place of the lowest bit that is set, and the bits without it. */
#define LOWEST(bits) (31u - clz((bits) & (0u - (bits))))
#define WITHOUT_LOWEST(bits) ((bits) & ((bits) - 1u))

/* A leaf's place among the simplices: the first, and how many. */
uint2 range_of(__global const Node *node, uint child) {
    uint byte = (child < 4 ? node->leaves.x : node->leaves.y) >> 8 * (child & 3u) & 0xffu;
    return (uint2)(node->simplices + (byte >> 3), byte & 7u);
}

/* The corners of a simplex. Devices take no more than so much memory in one piece, so a large mesh is in several. */
#if PIECES == 1
#define CORNERS(simplex) (corners_0 + D * (size_t)(simplex))
#else
#define CORNERS(simplex) corners_of(simplex, corners_0, corners_1, corners_2, corners_3)
__global const float4 *corners_of(
    uint simplex, __global const float4 *corners_0, __global const float4 *corners_1,
    __global const float4 *corners_2, __global const float4 *corners_3) {
    uint piece = simplex / PIECE, place = simplex % PIECE;
    __global const float4 *corners =
        piece < 2 ? (piece == 0 ? corners_0 : corners_1) : (piece == 2 ? corners_2 : corners_3);
    return corners + D * (size_t)place;
}
#endif
#define MESH \
    __global const Node *nodes, __global const float4 *corners_0, __global const float4 *corners_1, \
    __global const float4 *corners_2, __global const float4 *corners_3, __global const uint *simplices

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

#ifdef SORTED
/* Rays that go into the same direction are work for neighbours: they visit the same nodes. Of each group's rays the work-item
   gets the one at its place in an order of directions, octant after octant. */
size_t sorted(float4 direction, __local ushort *keys) {
    uint local_place = (uint)get_local_id(0), key = 0;
    const float w[4] = {direction.x, direction.y, direction.z, direction.w};
    for (int axis = 0; axis < D; axis++) {
        uint cell = (uint)clamp((w[axis] + 1.0f) * 2.0f, 0.0f, 3.0f);
        key |= (cell >> 1) << (D + axis) | (cell & 1u) << axis;
    }
    keys[local_place] = (ushort)(key * GROUP + local_place);
    for (uint size = 2; size <= GROUP; size <<= 1) {
        for (uint step = size >> 1; step > 0; step >>= 1) {
            barrier(CLK_LOCAL_MEM_FENCE);
            uint other = local_place ^ step;
            ushort own = keys[local_place], its = keys[other];
            barrier(CLK_LOCAL_MEM_FENCE);
            /* The lower of the two places keeps the smaller key where the sequence rises. */
            bool keeps_smaller = (local_place < other) == ((local_place & size) == 0);
            keys[local_place] = keeps_smaller ? min(own, its) : max(own, its);
        }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    return get_global_id(0) - local_place + keys[local_place] % GROUP;
}
#endif

/* Whether anything blocks each ray of each point: for every ray HIT, OPEN or UNSURE, which the host settles. Rays come from
   `given`, or where that is not used from the points' sequences. */
#define DIRECTION(i) \
    cleaned(use_given ? given[i] : sampled(points[(i) / rays], points[(i) / rays].next + (uint)((i) % rays), matrices))

__kernel void occluded(
    MESH, uint empty, __global const Point *points, __global const StarCone *star, __global const uint *matrices,
    __global const float4 *given, uint use_given, uint rays, ulong count, float limit, __global uchar *out) {
    size_t i = get_global_id(0);
#ifdef SORTED
    __local ushort keys[GROUP];
    i = sorted(i < count ? DIRECTION(i) : (float4)(0.0f), keys);
#endif
    if (i >= count) return;
    Point point = points[i / rays];
    float4 direction = DIRECTION(i);
    uint found = hidden_by_star(point, direction, star);
    if (found == HIT || empty) {
        out[i] = (uchar)found;
        return;
    }
    float4 inverse = inverted(direction);
    /* Children that are to be visited: the first of a node's, and a bit for each. */
    uint2 stack[DEPTH], group = (uint2)(0u, 1u);
    uint depth = 0;
    for (;;) {
        __global const Node *node = nodes + group.x + LOWEST(group.y);
        group.y = WITHOUT_LOWEST(group.y);
        if (group.y != 0) stack[depth++] = group;
        float8 distances;
        uint met_boxes = boxes(node, point.position, inverse, limit, &distances);
        uint inner = node->inner;
        for (uint leaves = met_boxes >> inner; leaves != 0; leaves = WITHOUT_LOWEST(leaves)) {
            uint2 range = range_of(node, inner + LOWEST(leaves));
            for (uint k = range.x; k < range.x + range.y; k++) {
                if (simplices[k] == point.ignored) continue;
                float t, t_error;
                uint one = met(point.position, direction, CORNERS(k), limit, &t, &t_error);
                if (one == HIT) {
                    out[i] = HIT;
                    return;
                }
                if (one == UNSURE) found = UNSURE;
            }
        }
        group = (uint2)(node->children, met_boxes & ((1u << inner) - 1u));
        if (group.y == 0) {
            if (depth == 0) break;
            group = stack[--depth];
        }
    }
    out[i] = (uchar)found;
}

/* The simplex that each ray hits first: its number, NONE if there is none, or UNSURE_SIMPLEX. If `bounded`, hits count
   only behind the ray's hit of the simplex `after`, if that is not NONE, whose distance lies between the two of `bounds`:
   nearer hits do not count, farther ones do, and what lies between makes the ray unsure. */
#define UNSURE_SIMPLEX 0xfffffffeu

__kernel void first_hit(
    MESH, uint empty, __global const float4 *origins, __global const float4 *given, uint bounded,
    __global const uint *after, __global const float2 *bounds, ulong count, __global uint *out) {
    size_t i = get_global_id(0);
    if (i >= count) return;
    if (empty) {
        out[i] = NONE;
        return;
    }
    float4 position = origins[i], direction = cleaned(given[i]);
    float4 inverse = inverted(direction);
    uint passed = bounded ? after[i] : NONE;
    float2 bound = bounded ? bounds[i] : (float2)(0.0f, 0.0f);
    uint best = NONE;
    float nearest = INFINITY, error = 0.0f, doubt = INFINITY;
    /* Nodes that are to be visited, the nearest on top, and the distances of their boxes. */
    uint stack[7 * DEPTH + 1];
    float entered[7 * DEPTH + 1];
    stack[0] = 0;
    entered[0] = 0.0f;
    uint depth = 1;
    while (depth > 0) {
        depth--;
        float limit = nearest + error;
        if (entered[depth] > limit * (1.0f + 2e-6f)) continue;
        __global const Node *node = nodes + stack[depth];
        float8 distances;
        uint met_boxes = boxes(node, position, inverse, limit, &distances);
        uint inner = node->inner;
        for (uint leaves = met_boxes >> inner; leaves != 0; leaves = WITHOUT_LOWEST(leaves)) {
            uint2 range = range_of(node, inner + LOWEST(leaves));
            for (uint k = range.x; k < range.x + range.y; k++) {
                if (passed != NONE && simplices[k] == passed) continue;
                float t, t_error;
                uint one = met(position, direction, CORNERS(k), INFINITY, &t, &t_error);
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
        float enter[8];
        vstore8(distances, 0, enter);
        uint bottom = depth;
        for (uint nodes_met = met_boxes & ((1u << inner) - 1u); nodes_met != 0; nodes_met = WITHOUT_LOWEST(nodes_met)) {
            uint child = LOWEST(nodes_met), place = depth++;
            for (; place > bottom && entered[place - 1] < enter[child]; place--) {
                stack[place] = stack[place - 1];
                entered[place] = entered[place - 1];
            }
            stack[place] = node->children + child;
            entered[place] = enter[child];
        }
    }
    out[i] = doubt <= nearest + error ? UNSURE_SIMPLEX : best;
}
