/* The directions of src/trace/sampling.rs, by the same operations in the same order: the same bits. Products must
   not be fused into sums, and divisions and roots must be rounded correctly; the host tries both beforehand. */

#pragma OPENCL FP_CONTRACT OFF

/* The bits of a number, or of each of several, in reverse order. */
#define REVERSE(x) \
    x = (x >> 1 & 0x55555555u) | (x & 0x55555555u) << 1; \
    x = (x >> 2 & 0x33333333u) | (x & 0x33333333u) << 2; \
    x = (x >> 4 & 0x0f0f0f0fu) | (x & 0x0f0f0f0fu) << 4; \
    x = (x >> 8 & 0x00ff00ffu) | (x & 0x00ff00ffu) << 8; \
    x = x >> 16 | x << 16;

/* Owen's scrambling of the bits, highest first. */
#define SCRAMBLE(x, key) \
    REVERSE(x) \
    x ^= x * 0x3d20adeau; \
    x += key; \
    x *= key >> 16 | 1u; \
    x ^= x * 0x05526c56u; \
    x ^= x * 0x53a22864u; \
    REVERSE(x)

uint reversed(uint x) {
    REVERSE(x)
    return x;
}

uint scramble(uint x, uint key) {
    SCRAMBLE(x, key)
    return x;
}

/* A coordinate of a point. Of the second and third dimension's matrices the host tells what the columns of each byte of an index add up
   to, 256 sums a byte. */
uint sobol(uint index, uint dimension, __global const uint *sums) {
    if (dimension == 0) return reversed(index);
    __global const uint *of = sums + 1024 * (dimension - 1);
    return of[index & 0xffu] ^ of[256 + (index >> 8 & 0xffu)] ^ of[512 + (index >> 16 & 0xffu)] ^ of[768 + (index >> 24)];
}

float unit(uint bits) {
    return ((float)(bits >> 8) + 0.5f) * (1.0f / 8388608.0f) - 1.0f;
}

/* Sine and cosine of x pi / 4. */
float2 sin_cos_quarter(float x) {
    float y = x * 0.785398163397448309615660845819875721f;
    float z = y * y;
    float s = y * (1.0f + z * (-1.0f / 6.0f + z * (1.0f / 120.0f + z * (-1.0f / 5040.0f + z * (1.0f / 362880.0f)))));
    float c = 1.0f + z * (-0.5f + z * (1.0f / 24.0f + z * (-1.0f / 720.0f + z * (1.0f / 40320.0f))));
    return (float2)(s, c);
}

/* The square onto the disk. */
float2 square_to_disk(float a, float b) {
    if (a == 0.0f && b == 0.0f) return (float2)(0.0f, 0.0f);
    if (fabs(a) > fabs(b)) {
        float2 t = sin_cos_quarter(b / a);
        return (float2)(a * t.y, a * t.x);
    }
    float2 t = sin_cos_quarter(a / b);
    return (float2)(b * t.x, b * t.y);
}

/* The cube onto the ball. */
float4 cube_to_ball(float a, float b, float c) {
    float2 xy = square_to_disk(a, b);
    float radius = max(fabs(a), fabs(b));
    float shell = max(radius, fabs(c));
    if (shell == 0.0f) return (float4)(0.0f, 0.0f, 0.0f, 0.0f);
    float cosine;
    if (fabs(c) >= radius) {
        float r = radius / shell;
        cosine = copysign(1.0f - r * r * (1.0f / 3.0f), c);
    } else {
        cosine = c / shell * (2.0f / 3.0f);
    }
    float across = radius == 0.0f ? 0.0f : shell * sqrt(max(1.0f - cosine * cosine, 0.0f)) / radius;
    return (float4)(xy.x * across, xy.y * across, shell * cosine, 0.0f);
}

/* Ray number `next` of a point. */
float4 sampled(Point point, uint next, __global const uint *sums) {
    uint index = scramble(next, point.keys.w);
    float a = unit(scramble(sobol(index, 0, sums), point.keys.x));
    float b = unit(scramble(sobol(index, 1, sums), point.keys.y));
    float4 local_;
    float square;
#if D == 4
    float c = unit(scramble(sobol(index, 2, sums), point.keys.z));
    local_ = cube_to_ball(a, b, c);
    square = local_.x * local_.x + local_.y * local_.y;
    square = square + local_.z * local_.z;
    local_.w = sqrt(max(1.0f - square, LOWEST_SQUARED_COSINE));
    float product = point.axis.x * local_.x + point.axis.y * local_.y;
    product = product + point.axis.z * local_.z;
    product = product + point.axis.w * local_.w;
#else
    float2 disk = square_to_disk(a, b);
    local_ = (float4)(disk.x, disk.y, 0.0f, 0.0f);
    square = local_.x * local_.x + local_.y * local_.y;
    local_.z = sqrt(max(1.0f - square, LOWEST_SQUARED_COSINE));
    float product = point.axis.x * local_.x + point.axis.y * local_.y;
    product = product + point.axis.z * local_.z;
#endif
    float scale = point.factor * product;
    float4 world = local_ - scale * point.axis;
    return point.turned ? -world : world;
}

#ifdef SETS
/* The same for eight rays, from number `next` on, which is a multiple of 8; without branches. Coordinates of points are never zero. */

/* A coordinate of the points, of whose indices all bits but the lowest three are those of `base`. */
float8 coordinate_of_8(uint8 index, uint base, uint dimension, uint key, __global const uint *sums) {
    uint8 x = (uint8)(sobol(base, dimension, sums));
    if (dimension == 0)
        x |= (index & 1u) << 31 | (index & 2u) << 29 | (index & 4u) << 27;
    else
        for (uint bit = 0; bit < 3; bit++) x ^= (0u - (index >> bit & 1u)) & sums[1024 * (dimension - 1) + (1u << bit)];
    SCRAMBLE(x, key)
    return (convert_float8(as_int8(x >> 8)) + 0.5f) * (1.0f / 8388608.0f) - 1.0f;
}

void sampled_8(Point point, uint next, __global const uint *sums, float8 *out) {
    uint8 index = next + (uint8)(0, 1, 2, 3, 4, 5, 6, 7);
    uint key = point.keys.w;
    SCRAMBLE(index, key)
    uint base = index.s0 & ~7u;
    float8 a = coordinate_of_8(index, base, 0, point.keys.x, sums);
    float8 b = coordinate_of_8(index, base, 1, point.keys.y, sums);
    int8 first = fabs(a) > fabs(b);
    float8 large = select(b, a, first), small = select(a, b, first);
    float8 angle = small / large * 0.785398163397448309615660845819875721f, z = angle * angle;
    float8 sine = 1.0f + z * (-1.0f / 6.0f + z * (1.0f / 120.0f + z * (-1.0f / 5040.0f + z * (1.0f / 362880.0f))));
    sine = angle * sine;
    float8 cosine = 1.0f + z * (-0.5f + z * (1.0f / 24.0f + z * (-1.0f / 720.0f + z * (1.0f / 40320.0f))));
    float8 u = large * cosine, v = large * sine;
    float8 locals[4];
    locals[0] = select(v, u, first);
    locals[1] = select(u, v, first);
#if D == 4
    float8 c = coordinate_of_8(index, base, 2, point.keys.z, sums);
    float8 radius = max(fabs(a), fabs(b)), shell = max(radius, fabs(c)), r = radius / shell;
    float8 cap = copysign(1.0f - r * r * (1.0f / 3.0f), c), wall = c / shell * (2.0f / 3.0f);
    float8 height = select(wall, cap, (int8)(fabs(c) >= radius));
    float8 across = shell * sqrt(max(1.0f - height * height, (float8)(0.0f))) / radius;
    locals[0] = locals[0] * across;
    locals[1] = locals[1] * across;
    locals[2] = shell * height;
#endif
    float8 square = locals[0] * locals[0] + locals[1] * locals[1];
#if D == 4
    square = square + locals[2] * locals[2];
#endif
    locals[D - 1] = sqrt(max(1.0f - square, (float8)(LOWEST_SQUARED_COSINE)));
    const float axis[4] = {point.axis.x, point.axis.y, point.axis.z, point.axis.w};
    float8 product = axis[0] * locals[0] + axis[1] * locals[1];
    product = product + axis[2] * locals[2];
#if D == 4
    product = product + axis[3] * locals[3];
#endif
    float8 scale = point.factor * product;
    for (int k = 0; k < D; k++) {
        float8 world = locals[k] - scale * axis[k];
        out[k] = point.turned ? -world : world;
    }
}
#endif

/* Directions alone, to see whether this device makes the right ones. */
__kernel void directions(__global const Point *points, __global const uint *sums, uint rays, __global float4 *out) {
    size_t i = get_global_id(0);
    Point point = points[i / rays];
#ifdef SETS
    float8 eight[4];
    eight[3] = (float8)(0.0f);
    sampled_8(point, point.next + (uint)(i % rays & ~7u), sums, eight);
    float lanes[4][8];
    for (int k = 0; k < 4; k++) vstore8(eight[k], 0, lanes[k]);
    out[i] = (float4)(lanes[0][i % 8], lanes[1][i % 8], lanes[2][i % 8], lanes[3][i % 8]);
#else
    out[i] = sampled(point, point.next + (uint)(i % rays), sums);
#endif
}
