/* Sets of rays through the hierarchy, for devices that are processors: a work-item takes up to 64 rays of a point, and what
   lies side by side in their registers are the eight boxes of a node, or eight of the rays. The host tells SET, which is 64. */

#define LANES 8

typedef struct {
    float direction[D][SET];
    float inverse[D][SET];
} Rays;

float4 direction_of(const Rays *rays, uint i) {
    float last = D == 4 ? rays->direction[D - 1][i] : 0.0f;
    return (float4)(rays->direction[0][i], rays->direction[1][i], rays->direction[2][i], last);
}

/* The simplex' part of `crossed` is the same for all rays, which leaves products of their directions with D vectors. Returns the rays
   of the set that hit it for sure; *doubt are those that may. Rays are about 1 long, so the sizes of their components add up to
   sqrt(D) at most. */
ulong crossed_by(float4 position, const Rays *rays, __global const float4 *facet, ulong set, ulong *doubt) {
    const float rounding = 24.0f * HALF_ULP * 2.01f, tiny = 1e-30f;
    float4 normal = facet[1], e = facet[0] - position, e_size = fabs(e), determinant_parts = e * normal;
    float weights[D][D];
#if D == 4
    for (int n = 0; n < 3; n++) {
        __global const float *f = (__global const float *)(facet + 2) + 6 * n;
        weights[n][0] = e.y * f[0] + e.z * f[1] + e.w * f[2];
        weights[n][1] = e.z * f[3] + e.w * f[4] - e.x * f[0];
        weights[n][2] = e.w * f[5] - e.x * f[1] - e.y * f[3];
        weights[n][3] = -e.x * f[2] - e.y * f[4] - e.z * f[5];
    }
    float part = facet[6].z, size = facet[6].w;
    const float normals[4] = {normal.x, normal.y, normal.z, normal.w};
#else
    for (int n = 0; n < 2; n++) {
        float4 f = facet[2 + n];
        weights[n][0] = e.y * f.z - e.z * f.y;
        weights[n][1] = e.z * f.x - e.x * f.z;
        weights[n][2] = e.x * f.y - e.y * f.x;
    }
    float part = facet[2].w, size = facet[3].w;
    const float normals[3] = {normal.x, normal.y, normal.z};
#endif
    float s_e = SUM(e_size), determinant = SUM(determinant_parts);
    bool is_oriented = fabs(determinant) > rounding * s_e * size + tiny;
    float sign = determinant < 0.0f ? -1.0f : 1.0f;
    float bound = rounding * s_e * part + tiny, last_bound = rounding * size + tiny + (D - 1) * bound;
    for (int k = 0; k < D; k++) {
        weights[D - 1][k] = sign * normals[k];
        for (int n = 0; n < D - 1; n++) weights[n][k] *= sign;
    }
    ulong hit = 0, doubtful = 0;
    for (uint group = 0; group < SET / LANES; group++) {
        uint wanted = (uint)(set >> LANES * group) & 0xffu;
        if (wanted == 0) continue;
        float8 x = vload8(group, rays->direction[0]), y = vload8(group, rays->direction[1]);
        float8 z = vload8(group, rays->direction[2]);
#if D == 4
        float8 w = vload8(group, rays->direction[3]);
#define HEIGHT(n) (weights[n][0] * x + weights[n][1] * y + weights[n][2] * z + weights[n][3] * w)
#else
#define HEIGHT(n) (weights[n][0] * x + weights[n][1] * y + weights[n][2] * z)
#endif
        float8 a = HEIGHT(0), b = HEIGHT(1), last = HEIGHT(D - 1) - a - b, least = min(a, b), most = max(a, b);
#if D == 4
        float8 c = HEIGHT(2);
        least = min(least, c);
        most = max(most, c);
        last -= c;
#endif
        int8 below = (least < -bound) | (last < -last_bound), above = (most > bound) | (last > last_bound);
        int8 inside = (least > bound) & (last > last_bound);
        uint misses = is_oriented ? bits_of(below) : bits_of(below & above);
        uint hits = is_oriented ? bits_of(inside) & wanted : 0u;
        hit |= (ulong)hits << LANES * group;
        doubtful |= (ulong)(wanted & ~(misses | hits)) << LANES * group;
    }
    *doubt = doubtful;
    return hit;
}

/* Loops over axes that compilers leave as loops cost more than what is in them. In 3D the last axis comes twice in what follows. */
#define ALONG(axis) \
    { \
        float inverse = rays->inverse[axis][i]; \
        bool is_negative = inverse < 0.0f; \
        enter = max(enter, seen[axis][is_negative] * inverse); \
        leave = min(leave, seen[axis][!is_negative] * inverse); \
    }

/* Which rays of the set something blocks, and which perhaps. */
ulong blocked_of(MESH, Point point, const Rays *rays, ulong set, float limit, ulong *unsure) {
    float4 position = point.position, to_middle = *middle - position;
    const float way[4] = {to_middle.x, to_middle.y, to_middle.z, to_middle.w};
    ulong open = set, sets[7 * DEPTH + 8];
    uint stack[7 * DEPTH + 8], depth = 1;
    sets[0] = set;
    stack[0] = 0;
    *unsure = 0;
    while (depth > 0) {
        set = sets[--depth] & open;
        if (set == 0) continue;
        __global const Node *node = nodes + stack[depth];
        __global const float *from = (__global const float *)(sides + 4 * D * stack[depth]);
        /* The sides of the boxes as seen from the point, first those that a ray with a positive component meets first. */
        float8 seen[D][2];
        for (int axis = 0; axis < D; axis++)
            for (int end = 0; end < 2; end++) seen[axis][end] = vload8(2 * axis + end, from) + way[axis];
        ulong8 met_by = (ulong8)(0);
        for (ulong rest = set; rest != 0; rest = WITHOUT_LOWEST(rest)) {
            ulong bit = rest & (0ul - rest);
            uint i = 63u - (uint)clz(bit);
            float8 enter = (float8)(0.0f), leave = (float8)(limit);
            ALONG(0)
            ALONG(1)
            ALONG(2)
            ALONG(D - 1)
            met_by |= as_ulong8(convert_long8(enter <= leave)) & bit;
        }
        ulong of[8];
        vstore8(met_by, 0, of);
        uint inner = node->inner;
        uint2 bytes = node->leaves;
        for (uint child = inner; child < 8; child++) {
            uint byte = (child < 4 ? bytes.x : bytes.y) >> 8 * (child & 3u) & 0xffu;
            uint first = node->simplices + (byte >> 3), end = first + (byte & 7u);
            ulong left = of[child] & open;
            for (uint k = first; k < end && left != 0; k++) {
                if (point.vertex != NONE && any(vertices[k] == point.vertex)) continue;
                if (point.ignored != NONE && simplices[k] == point.ignored) continue;
                ulong doubt, hit = crossed_by(position, rays, FACET_OF(k), left, &doubt);
                if (limit != INFINITY) {
                    doubt |= hit;
                    hit = 0;
                }
                for (; doubt != 0; doubt = WITHOUT_LOWEST(doubt)) {
                    ulong bit = doubt & (0ul - doubt);
                    uint i = 63u - (uint)clz(bit);
                    uint one = met_before(position, direction_of(rays, i), FACET_OF(k), CORNERS(k), limit, false);
                    if (one == HIT) hit |= bit;
                    if (one == UNSURE) *unsure |= bit;
                }
                open &= ~hit;
                left &= ~hit;
            }
        }
        for (uint child = inner; child-- > 0;) {
            if ((of[child] & open) == 0) continue;
            stack[depth] = node->children + child;
            sets[depth++] = of[child];
        }
    }
    return ~open;
}

/* What becomes of each ray, as `occluded` tells it; a work-item for each 64 rays of a point. */
__kernel void occluded_sets(MESH, uint empty, RAYS, ulong count, __global uchar *out) {
    size_t item = get_global_id(0);
    if (item >= count) return;
    uint of_point = (rays + SET - 1) / SET, first = (uint)(item % of_point) * SET, own = min((uint)SET, rays - first);
    size_t begin = item / of_point * rays + first;
    Point point = points[item / of_point];
    float components[4][SET];
    if (use_given) {
        for (uint i = 0; i < own; i++) {
            float4 w = given[begin + i];
            const float one[4] = {w.x, w.y, w.z, w.w};
            for (int axis = 0; axis < D; axis++) components[axis][i] = one[axis];
        }
    } else {
        for (uint i = 0; i < own; i += LANES) {
            float8 eight[4];
            sampled_8(point, point.next + first + i, sums, eight);
            for (int axis = 0; axis < D; axis++) vstore8(eight[axis], i / LANES, components[axis]);
        }
    }
    /* Rays of an orthant side by side, as they are likely to go together. */
    uint orthants[SET], starts[(1 << D) + 1];
    for (uint orthant = 0; orthant <= 1 << D; orthant++) starts[orthant] = 0;
    for (uint i = 0; i < own; i++) {
        uint orthant = 0;
        for (int axis = 0; axis < D; axis++) {
            float w = components[axis][i];
            components[axis][i] = w = fabs(w) < 1e-30f ? 0.0f : w;
            orthant |= (uint)(w < 0.0f) << axis;
        }
        orthants[i] = orthant;
        starts[orthant + 1]++;
    }
    for (uint orthant = 0; orthant < 1 << D; orthant++) starts[orthant + 1] += starts[orthant];
    Rays all;
    uint lanes[SET];
    ulong hit = 0, unsure = 0;
    for (uint i = 0; i < own; i++) {
        uint lane = starts[orthants[i]]++;
        for (int axis = 0; axis < D; axis++) all.direction[axis][lane] = components[axis][i];
        lanes[i] = lane;
    }
    for (int axis = 0; axis < D; axis++) {
        for (uint lane = own; lane < SET; lane++) all.direction[axis][lane] = 1.0f;
        for (uint group = 0; group < SET / LANES; group++) {
            float8 w = vload8(group, all.direction[axis]);
            vstore8(1.0f / copysign(max(fabs(w), (float8)(1e-20f)), w), group, all.inverse[axis]);
        }
    }
    for (uint lane = 0; lane < own; lane++) {
        uint found = hidden_by_star(point, direction_of(&all, lane), star);
        hit |= (ulong)(found == HIT) << lane;
        unsure |= (ulong)(found == UNSURE) << lane;
    }
    ulong alive = (own == SET ? ~0ul : (1ul << own) - 1ul) & ~hit;
    if (!empty && alive != 0) {
        ulong doubt;
        hit |= blocked_of(THE_MESH, point, &all, alive, limit, &doubt);
        unsure |= doubt;
    }
    for (uint i = 0; i < own; i++)
        out[begin + i] = (uchar)(hit >> lanes[i] & 1ul ? HIT : unsure >> lanes[i] & 1ul ? UNSURE : OPEN);
}
