/* Whether a ray meets a simplex: the signs of src/geometry/cone.rs in double precision, where rounding leaves no doubt about
   them.

   The determinant of columns w, a, b, c doesn't change if a is subtracted from b and c. Then its rounding is relative to
   the simplex's own size rather than its distance, and few rays are in doubt. HALF_ULPS is more than all roundings: of
   the D factors of each of D! products, their multiplications and their sum, and of the bound itself. */

#define HALF_ULPS 40

/* The most exact numbers that the device has. */
#ifdef DOUBLE
typedef double real;
typedef double4 real4;
#define REAL4(v) convert_double4(v)
#define REAL_HALF_ULP 1.1102230246251565e-16
#else
typedef float real;
typedef float4 real4;
#define REAL4(v) (v)
#define REAL_HALF_ULP HALF_ULP
#endif

real size(real4 v) {
    return fabs(v.x) + fabs(v.y) + fabs(v.z) + fabs(v.w);
}

#if D == 4
real4 cross_(real4 a, real4 b, real4 c) {
    real xy = b.x * c.y - b.y * c.x, xz = b.x * c.z - b.z * c.x, xw = b.x * c.w - b.w * c.x;
    real yz = b.y * c.z - b.z * c.y, yw = b.y * c.w - b.w * c.y, zw = b.z * c.w - b.w * c.z;
    real4 n;
    n.x = a.y * zw - a.z * yw + a.w * yz;
    n.y = -(a.x * zw - a.z * xw + a.w * xz);
    n.z = a.x * yw - a.y * xw + a.w * xy;
    n.w = -(a.x * yz - a.y * xz + a.z * xy);
    return n;
}
#else
real4 cross_(real4 a, real4 b) {
    real4 n;
    n.x = a.y * b.z - a.z * b.y;
    n.y = a.z * b.x - a.x * b.z;
    n.z = a.x * b.y - a.y * b.x;
    n.w = 0;
    return n;
}
#endif

real dot_(real4 a, real4 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
}

#ifdef DOUBLE
/* HIT, OPEN or UNSURE. If HIT, *t is the distance and *t_error bounds its rounding. */
uint meets(float4 position, float4 direction, __global const float4 *corners, double *t, double *t_error) {
    const double tiny = 1e-30;
    const double rounding = HALF_ULPS * REAL_HALF_ULP;
    double4 p = convert_double4(position), w = convert_double4(direction);
    double4 v0 = convert_double4(corners[0]), v1 = convert_double4(corners[1]), v2 = convert_double4(corners[2]);
    double4 e0 = v0 - p, e1 = v1 - p, d1 = v1 - v0, d2 = v2 - v0, g2 = v2 - v1;
    double s_w = size(w) * rounding;
    double s_e0 = size(e0), s_e1 = size(e1), s_d1 = size(d1), s_d2 = size(d2);
    /* A direction with weights of both signs is outside of the cone and of its opposite; mostly two weights tell. All
       comparisons are such that what is not a number is in doubt. */
#if D == 4
    double4 v3 = convert_double4(corners[3]);
    double4 d3 = v3 - v0;
    double s_d3 = size(d3);
    double a = -dot_(cross_(e0, d2, d3), w), a_bound = s_w * s_e0 * s_d2 * s_d3 + tiny;
    double b = dot_(cross_(e0, d1, d3), w), b_bound = s_w * s_e0 * s_d1 * s_d3 + tiny;
#else
    double a = -dot_(cross_(e0, d2), w), a_bound = s_w * s_e0 * s_d2 + tiny;
    double b = dot_(cross_(e0, d1), w), b_bound = s_w * s_e0 * s_d1 + tiny;
#endif
    uint above = (a > a_bound) + (b > b_bound), below = (-a > a_bound) + (-b > b_bound);
    if (above > 0 && below > 0) return OPEN;
    double sum = fabs(a) + fabs(b), sum_bound = a_bound + b_bound;
#if D == 4
    a = -dot_(cross_(e0, d1, d2), w);
    a_bound = s_w * s_e0 * s_d1 * s_d2 + tiny;
    double4 g3 = v3 - v1;
    b = dot_(cross_(e1, g2, g3), w);
    b_bound = s_w * s_e1 * size(g2) * size(g3) + tiny;
    above += a > a_bound;
    below += -a > a_bound;
    sum += fabs(a);
    sum_bound += a_bound;
#else
    b = dot_(cross_(e1, g2), w);
    b_bound = s_w * s_e1 * size(g2) + tiny;
#endif
    above += b > b_bound;
    below += -b > b_bound;
    sum += fabs(b);
    sum_bound += b_bound;
    if (above > 0 && below > 0) return OPEN;
    if (above + below == 0) return UNSURE;
#if D == 4
    double determinant = dot_(cross_(d1, d2, d3), e0);
    double determinant_bound = rounding * s_e0 * s_d1 * s_d2 * s_d3 + tiny;
#else
    double determinant = dot_(cross_(d1, d2), e0);
    double determinant_bound = rounding * s_e0 * s_d1 * s_d2 + tiny;
#endif
    double oriented = above > 0 ? determinant : -determinant;
    if (-oriented > determinant_bound) return OPEN;
    if (!(oriented > determinant_bound) || above + below < D) return UNSURE;
    *t = oriented / sum;
    *t_error = 4 * *t * (sum_bound / sum + determinant_bound / oriented + 4 * REAL_HALF_ULP);
    return HIT;
}
#endif
