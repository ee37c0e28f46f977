/* The recursion of vehnav/strapdown/enu.py in C: the yardstick of `make bench`.
 *
 * Same formulas, same inputs, same outputs; compiled with -O3 and called by bench_kernel.py.
 */
#include <math.h>
#include <stdint.h>

typedef struct { double x, y, z; } vec;
typedef struct { double m[9]; } mat;
typedef struct { double a, e2, gamma_e, gamma_p, omega, f, m; } ellipsoid;
typedef struct { double radius_m; vec unfelt; } memory;

static inline vec v(double x, double y, double z) { vec r = {x, y, z}; return r; }
static inline vec add(vec a, vec b) { return v(a.x + b.x, a.y + b.y, a.z + b.z); }
static inline vec mul(double k, vec a) { return v(k * a.x, k * a.y, k * a.z); }
static inline vec cross(vec a, vec b)
{
    return v(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
static inline vec apply(const mat *c, vec a)
{
    const double *m = c->m;
    return v(m[0] * a.x + m[1] * a.y + m[2] * a.z,
             m[3] * a.x + m[4] * a.y + m[5] * a.z,
             m[6] * a.x + m[7] * a.y + m[8] * a.z);
}
static inline vec apply_t(const mat *c, vec a)
{
    const double *m = c->m;
    return v(m[0] * a.x + m[3] * a.y + m[6] * a.z,
             m[1] * a.x + m[4] * a.y + m[7] * a.z,
             m[2] * a.x + m[5] * a.y + m[8] * a.z);
}
static inline mat product(const mat *a, const mat *b)
{
    mat r;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            r.m[3 * i + j] = a->m[3 * i] * b->m[j] + a->m[3 * i + 1] * b->m[3 + j]
                           + a->m[3 * i + 2] * b->m[6 + j];
    return r;
}

/* sin t / t, (1 - cos t) / t^2, (1 - sin t / t) / t^2 of t^2 */
static inline vec coefficients(double t2)
{
    if (t2 < 0.01)
        return v(1.0 - t2 / 6.0 * (1.0 - t2 / 20.0 * (1.0 - t2 / 42.0 * (1.0 - t2 / 72.0))),
                 0.5 - t2 / 24.0 * (1.0 - t2 / 30.0 * (1.0 - t2 / 56.0 * (1.0 - t2 / 90.0))),
                 (1.0 / 6.0) * (1.0 - t2 / 20.0 * (1.0 - t2 / 42.0
                     * (1.0 - t2 / 72.0 * (1.0 - t2 / 110.0)))));
    double t = sqrt(t2), s = sin(t) / t;
    return v(s, (1.0 - cos(t)) / t2, (1.0 - s) / t2);
}
static inline mat rotation(vec p)
{
    vec k = coefficients(p.x * p.x + p.y * p.y + p.z * p.z);
    double s = k.x, c = k.y;
    mat r = {{1.0 - c * (p.y * p.y + p.z * p.z), c * p.x * p.y - s * p.z, c * p.x * p.z + s * p.y,
              c * p.x * p.y + s * p.z, 1.0 - c * (p.x * p.x + p.z * p.z), c * p.y * p.z - s * p.x,
              c * p.x * p.z - s * p.y, c * p.y * p.z + s * p.x, 1.0 - c * (p.x * p.x + p.y * p.y)}};
    return r;
}

static inline void radii(double lat, double h, const ellipsoid *e, double *rm, double *rn)
{
    double s = sin(lat), w2 = 1.0 - e->e2 * s * s, n = e->a / sqrt(w2);
    *rm = n * (1.0 - e->e2) / w2 + h;
    *rn = n + h;
}
static inline double gravity_at(double lat, double h, const ellipsoid *e)
{
    double s2 = sin(lat) * sin(lat);
    double k = sqrt(1.0 - e->e2) * e->gamma_p / e->gamma_e - 1.0;
    double g = e->gamma_e * (1.0 + k * s2) / sqrt(1.0 - e->e2 * s2), x = h / e->a;
    return g * (1.0 - 2.0 * (1.0 + e->f + e->m - 2.0 * e->f * s2) * x + 3.0 * x * x);
}
static inline vec earth_rate(double lat, const ellipsoid *e)
{
    return v(0.0, e->omega * cos(lat), e->omega * sin(lat));
}
static inline vec transport(vec u, double rm, double rn, double tan_lat)
{
    return v(-u.y / rm, u.x / rn, u.x * tan_lat / rn);
}
static inline vec unfelt(vec u, vec ie, vec en, double g, vec dv)
{
    vec a = add(cross(u, add(mul(2.0, ie), en)), mul(-0.5, cross(add(ie, en), dv)));
    return v(a.x, a.y, a.z - g);
}

void integrate(int64_t n, const double *t, const double *dtheta, const double *dvel,
               const uint8_t *coast, const double *gain, const int64_t *stop_id, int64_t reset,
               const double *start, int64_t clamp, double gravity_height, const ellipsoid *e,
               double *out_position, double *out_velocity, double *out_attitude,
               double *out_before, double *out_tilt)
{
    vec position = v(start[0], start[1], start[2]), u = v(start[3], start[4], start[5]);
    mat c;
    for (int i = 0; i < 9; i++) c.m[i] = start[6 + i];
    vec th_prev = v(0, 0, 0), dv_prev = v(0, 0, 0);
    double dt_prev = 0.0, rm, rn;
    int64_t seen = -1;
    memory mem;
    radii(position.x, position.z, e, &rm, &rn);
    mem.radius_m = rm;
    mem.unfelt = unfelt(u, earth_rate(position.x, e), transport(u, rm, rn, tan(position.x)),
                        gravity_at(position.x, isnan(gravity_height) ? position.z : gravity_height, e),
                        apply(&c, v(dvel[0], dvel[1], dvel[2])));
    if (stop_id[0] >= 0) {
        seen = stop_id[0];
        out_before[3 * seen] = u.x; out_before[3 * seen + 1] = u.y; out_before[3 * seen + 2] = u.z;
        if (reset) u = v(0, 0, 0);
    }
    for (int64_t k = 0; k < n; k++) {
        if (k > 0) {
            int64_t i = k - 1, stop = stop_id[k];
            double dt = t[k] - t[i];
            vec th = v(dtheta[3 * i], dtheta[3 * i + 1], dtheta[3 * i + 2]);
            vec dv = v(dvel[3 * i], dvel[3 * i + 1], dvel[3 * i + 2]);
            double cone = 0.0;
            if (dt_prev != 0.0 && !coast[i]) {
                cone = dt / (6.0 * (dt + dt_prev));
                th_prev = mul(dt / dt_prev, th_prev);
                dv_prev = mul(dt / dt_prev, dv_prev);
            }
            vec phi = add(th, mul(cone, cross(th_prev, th)));
            vec q = coefficients(th.x * th.x + th.y * th.y + th.z * th.z);
            vec once = cross(th, dv), twice = cross(th, once);
            vec dv_b = add(dv, add(mul(q.y, once), mul(q.z, twice)));
            dv_b = add(dv_b, mul(cone, add(cross(th_prev, dv), cross(dv_prev, th))));
            vec dv_n = apply(&c, dv_b);

            vec mid = coast[i] ? u : add(u, mul(0.5, add(dv_n, mul(dt, mem.unfelt))));
            if (clamp) mid.z = 0.0;
            double lat_mid = position.x + 0.5 * dt * mid.y / mem.radius_m;
            double h_mid = position.z + 0.25 * dt * (u.z + mid.z);
            radii(lat_mid, h_mid, e, &rm, &rn);
            double g = gravity_at(lat_mid, isnan(gravity_height) ? h_mid : gravity_height, e);
            double cos_lat = cos(lat_mid);
            vec ie = earth_rate(lat_mid, e), en = transport(mid, rm, rn, sin(lat_mid) / cos_lat);

            vec control = v(0, 0, 0);
            if (gain[i] > 0.0) {
                vec f = mul(1.0 / dt, dv_n);
                control = mul(fabs(dt), v(-gain[i] / g * f.y, gain[i] / g * f.x, 0.0));
            }
            vec zeta = add(mul(dt, add(ie, en)), control);
            mat frame = rotation(mul(-1.0, zeta)), body = rotation(phi);
            mat turned = product(&c, &body), c_new = product(&frame, &turned);

            mem.radius_m = rm;
            mem.unfelt = unfelt(mid, ie, en, g, dv_n);
            vec u_new = add(u, add(dv_n, mul(dt, mem.unfelt)));
            if (coast[i]) u_new = apply(&c_new, apply_t(&c, u));
            if (clamp) u_new.z = 0.0;
            vec before = u_new;
            if (reset && stop >= 0) u_new = v(0, 0, 0);
            position = v(position.x + 0.5 * dt * (u.y + u_new.y) / rm,
                         position.y + 0.5 * dt * (u.x + u_new.x) / (rn * cos_lat),
                         position.z + 0.5 * dt * (u.z + u_new.z));
            u = u_new;
            c = c_new;
            if (stop >= 0) {
                if (stop != seen) {
                    seen = stop;
                    out_before[3 * stop] = before.x;
                    out_before[3 * stop + 1] = before.y;
                    out_before[3 * stop + 2] = before.z;
                }
                out_tilt[2 * stop] += control.x;
                out_tilt[2 * stop + 1] += control.y;
            }
            th_prev = th;
            dv_prev = dv;
            dt_prev = coast[i] ? 0.0 : dt;
        }
        double *p = out_position + 3 * k, *w = out_velocity + 3 * k, *a = out_attitude + 9 * k;
        p[0] = position.x; p[1] = position.y; p[2] = position.z;
        w[0] = u.x; w[1] = u.y; w[2] = u.z;
        for (int j = 0; j < 9; j++) a[j] = c.m[j];
    }
}
