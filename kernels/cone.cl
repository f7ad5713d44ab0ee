/* Whether a ray meets a simplex: the signs of src/geometry/cone.rs, where rounding leaves no doubt about them. This text is
   compiled for REAL = float and, where the device has it, for REAL = double.

   The determinant of columns w, a, b, c doesn't change if a is subtracted from b and c. Then its rounding is relative to
   the simplex's own size rather than its distance, and few rays are in doubt. HALF_ULPS is more than all roundings: of
   the D factors of each of D! products, their multiplications and their sum, and of the bound itself. */

#define HALF_ULPS 40

REAL NAME(size)(REAL4 v) {
    return fabs(v.x) + fabs(v.y) + fabs(v.z) + fabs(v.w);
}

#if D == 4
REAL4 NAME(cross_)(REAL4 a, REAL4 b, REAL4 c) {
    REAL xy = b.x * c.y - b.y * c.x, xz = b.x * c.z - b.z * c.x, xw = b.x * c.w - b.w * c.x;
    REAL yz = b.y * c.z - b.z * c.y, yw = b.y * c.w - b.w * c.y, zw = b.z * c.w - b.w * c.z;
    REAL4 n;
    n.x = a.y * zw - a.z * yw + a.w * yz;
    n.y = -(a.x * zw - a.z * xw + a.w * xz);
    n.z = a.x * yw - a.y * xw + a.w * xy;
    n.w = -(a.x * yz - a.y * xz + a.z * xy);
    return n;
}
#else
REAL4 NAME(cross_)(REAL4 a, REAL4 b) {
    REAL4 n;
    n.x = a.y * b.z - a.z * b.y;
    n.y = a.z * b.x - a.x * b.z;
    n.z = a.x * b.y - a.y * b.x;
    n.w = 0;
    return n;
}
#endif

REAL NAME(dot_)(REAL4 a, REAL4 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
}

/* HIT, OPEN or UNSURE. If HIT, *t is the distance and *t_error bounds its rounding. */
uint NAME(meets)(float4 position, float4 direction, __global const float4 *corners, REAL *t, REAL *t_error) {
    const REAL tiny = (REAL)1e-30f;
    const REAL rounding = HALF_ULPS * HALF_ULP;
    REAL4 p = CONVERT(position), w = CONVERT(direction);
    REAL4 v0 = CONVERT(corners[0]), v1 = CONVERT(corners[1]), v2 = CONVERT(corners[2]);
    REAL4 e0 = v0 - p, e1 = v1 - p, d1 = v1 - v0, d2 = v2 - v0, g2 = v2 - v1;
    REAL s_w = NAME(size)(w) * rounding;
    REAL s_e0 = NAME(size)(e0), s_e1 = NAME(size)(e1), s_d1 = NAME(size)(d1), s_d2 = NAME(size)(d2);
    /* A direction with weights of both signs is outside of the cone and of its opposite; mostly two weights tell. All
       comparisons are such that what is not a number is in doubt. */
#if D == 4
    REAL4 v3 = CONVERT(corners[3]);
    REAL4 d3 = v3 - v0;
    REAL s_d3 = NAME(size)(d3);
    REAL a = -NAME(dot_)(NAME(cross_)(e0, d2, d3), w), a_bound = s_w * s_e0 * s_d2 * s_d3 + tiny;
    REAL b = NAME(dot_)(NAME(cross_)(e0, d1, d3), w), b_bound = s_w * s_e0 * s_d1 * s_d3 + tiny;
#else
    REAL a = -NAME(dot_)(NAME(cross_)(e0, d2), w), a_bound = s_w * s_e0 * s_d2 + tiny;
    REAL b = NAME(dot_)(NAME(cross_)(e0, d1), w), b_bound = s_w * s_e0 * s_d1 + tiny;
#endif
    uint above = (a > a_bound) + (b > b_bound), below = (-a > a_bound) + (-b > b_bound);
    if (above > 0 && below > 0) return OPEN;
    REAL sum = fabs(a) + fabs(b), sum_bound = a_bound + b_bound;
#if D == 4
    a = -NAME(dot_)(NAME(cross_)(e0, d1, d2), w);
    a_bound = s_w * s_e0 * s_d1 * s_d2 + tiny;
    REAL4 g3 = v3 - v1;
    b = NAME(dot_)(NAME(cross_)(e1, g2, g3), w);
    b_bound = s_w * s_e1 * NAME(size)(g2) * NAME(size)(g3) + tiny;
    above += a > a_bound;
    below += -a > a_bound;
    sum += fabs(a);
    sum_bound += a_bound;
#else
    b = NAME(dot_)(NAME(cross_)(e1, g2), w);
    b_bound = s_w * s_e1 * NAME(size)(g2) + tiny;
#endif
    above += b > b_bound;
    below += -b > b_bound;
    sum += fabs(b);
    sum_bound += b_bound;
    if (above > 0 && below > 0) return OPEN;
    if (above + below == 0) return UNSURE;
#if D == 4
    REAL determinant = NAME(dot_)(NAME(cross_)(d1, d2, d3), e0);
    REAL determinant_bound = rounding * s_e0 * s_d1 * s_d2 * s_d3 + tiny;
#else
    REAL determinant = NAME(dot_)(NAME(cross_)(d1, d2), e0);
    REAL determinant_bound = rounding * s_e0 * s_d1 * s_d2 + tiny;
#endif
    REAL oriented = above > 0 ? determinant : -determinant;
    if (-oriented > determinant_bound) return OPEN;
    if (!(oriented > determinant_bound) || above + below < D) return UNSURE;
    *t = oriented / sum;
    *t_error = 4 * *t * (sum_bound / sum + determinant_bound / oriented + 4 * HALF_ULP);
    return HIT;
}
