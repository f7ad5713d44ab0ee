// Vertex ambient occlusion with Intel Embree 3: the 3D anchor.
//   g++ -std=c++17 -O3 -march=native -ffp-contract=off embree_ao.cpp -o embree_ao -lembree3 -lpthread
// Variants: gen (ray generation only), o1, o1c (coherent flag), o4, o8, s1M / s1Mc (AoS stream, incoherent / coherent flag),
//           sNp / sNpc (SoA stream), x8 / x8c (packets of one sample index across 8 consecutive vertices; use --sampler shared),
//           xs / xsc (SoA streams of one sample index across 64 consecutive vertices).  --flags none|robust|compact|robust+compact  --quality low|medium|high
#include "ao_common.h"
#include <embree3/rtcore.h>
#include <pmmintrin.h>
#include <xmmintrin.h>

static std::atomic<ssize_t> g_mem{0}, g_peak{0};
static bool memfn(void*, ssize_t b, bool) { ssize_t v = (g_mem += b); ssize_t p = g_peak; while (v > p && !g_peak.compare_exchange_weak(p, v)) {} return true; }
static void errfn(void*, RTCError e, const char* s) { fprintf(stderr, "embree error %d %s\n", int(e), s); exit(1); }

struct Buf { std::vector<float> d[3]; float* p[3]; explicit Buf(int n) { for (int k = 0; k < 3; k++) { d[k].assign(n + 16, 0.f); p[k] = d[k].data(); } } };

int main(int argc, char** argv) {
  _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON); _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
  Args a(argc, argv, "o1");
  if (a.has("--header")) csv_header();
  Mesh m = load_mesh(a.mesh);
  if (m.dim != 3) { fprintf(stderr, "3D only\n"); return 1; }
  auto nrm = vertex_normals<3>(m);
  float eps = float(1e-4 * scene_diagonal(m));
  auto list = work_list<3>(m, a.n, a.maxrays, a.order == "morton");
  Sampler<3> smp; smp.init(a.n, a.sampler == "strat" ? 1 : a.sampler == "shared" ? 2 : 0, a.pattern);
  std::vector<float> ao(m.nv, 1.f);
  const int N = a.n;
  auto do_scene = [&](int bthreads, bool keep, double& secs, double& mb, RTCDevice& dev, RTCScene& sc) {
    g_mem = 0; g_peak = 0;
    dev = rtcNewDevice(("threads=" + std::to_string(bthreads) + ",set_affinity=0").c_str());
    rtcSetDeviceErrorFunction(dev, errfn, nullptr);
    rtcSetDeviceMemoryMonitorFunction(dev, memfn, nullptr);
    sc = rtcNewScene(dev);
    int fl = 0;
    if (a.flags.find("robust") != std::string::npos) fl |= RTC_SCENE_FLAG_ROBUST;
    if (a.flags.find("compact") != std::string::npos) fl |= RTC_SCENE_FLAG_COMPACT;
    rtcSetSceneFlags(sc, RTCSceneFlags(fl));
    rtcSetSceneBuildQuality(sc, a.quality == "high" ? RTC_BUILD_QUALITY_HIGH : a.quality == "low" ? RTC_BUILD_QUALITY_LOW : RTC_BUILD_QUALITY_MEDIUM);
    RTCGeometry g = rtcNewGeometry(dev, RTC_GEOMETRY_TYPE_TRIANGLE);
    float* vb = (float*)rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, m.nv);
    memcpy(vb, m.v.data(), m.v.size() * 4);
    unsigned* ib = (unsigned*)rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, m.nf);
    memcpy(ib, m.f.data(), m.f.size() * 4);
    rtcCommitGeometry(g); rtcAttachGeometry(sc, g); rtcReleaseGeometry(g);
    double t0 = now();
    rtcCommitScene(sc);
    secs = now() - t0;
    mb = g_mem / 1048576.0;
    if (!keep) { rtcReleaseScene(sc); rtcReleaseDevice(dev); }
  };
  for (auto& ts : csv_split(a.threads)) {
    int T = atoi(ts.c_str());
    std::vector<double> bs; double s = 0, mb = 0; RTCDevice dev; RTCScene sc;
    for (int r = 0; r < 2; r++) { do_scene(T, false, s, mb, dev, sc); bs.push_back(s); }
    do_scene(T, true, s, mb, dev, sc); bs.push_back(s);
    double build = median(bs);
    for (auto& var : csv_split(a.variants)) {
      std::vector<Buf> bufs; for (int t = 0; t < T; t++) bufs.emplace_back(N);
      std::vector<std::vector<float>> xbuf(T);
      std::vector<std::vector<RTCRay>> aos(T); for (auto& x : aos) x.resize(N + 8);
      std::vector<std::vector<float>> soa(T); for (auto& x : soa) x.assign(size_t(N + 16) * 16, 0.f);
      auto body = [&](int t, size_t b, size_t e) {
        _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON); _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
        RTCIntersectContext ctx; rtcInitIntersectContext(&ctx);
        if (var.back() == 'c') ctx.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
        Buf& bf = bufs[t];
        const float inf = INFINITY;
        if (var[0] == 'x') {
          const size_t S = 64;  // block of up to 64 vertices; rays stored [sample][component][vertex]
          std::vector<float>& q = xbuf[t]; q.resize(size_t(N) * 3 * S + 16);
          std::vector<int> hits(S, 0);
          alignas(64) float og[3][S] = {}, w[12][S];
          size_t cnt = e - b;
          for (size_t i = 0; i < cnt; i++) {
            uint32_t v = list[b + i]; const float* n = &nrm[size_t(v) * 3];
            for (int d = 0; d < 3; d++) og[d][i] = m.v[size_t(v) * 3 + d] + eps * n[d];
            smp.generate(v, n, bf.p);
            for (int k = 0; k < N; k++) for (int d = 0; d < 3; d++) q[(size_t(k) * 3 + d) * S + i] = bf.p[d][k];
          }
          for (int k = 0; k < N; k++) {
            const float* dk = &q[size_t(k) * 3 * S];
            if (var[1] == '8') {
              for (size_t i = 0; i < cnt; i += 8) {
                RTCRay8 r; alignas(32) int valid[8];
                for (int j = 0; j < 8; j++) {
                  valid[j] = i + j < cnt ? -1 : 0; r.tnear[j] = 0; r.time[j] = 0; r.tfar[j] = inf; r.mask[j] = -1; r.id[j] = j; r.flags[j] = 0;
                  r.org_x[j] = og[0][i + j]; r.org_y[j] = og[1][i + j]; r.org_z[j] = og[2][i + j];
                  r.dir_x[j] = dk[i + j]; r.dir_y[j] = dk[S + i + j]; r.dir_z[j] = dk[2 * S + i + j];
                }
                rtcOccluded8(valid, sc, &ctx, &r);
                for (int j = 0; j < 8; j++) hits[i + j] += valid[j] && r.tfar[j] < 0;
              }
            } else {
              memcpy(w[0], og, sizeof og); memcpy(w[4], dk, 3 * S * 4);
              for (size_t i = 0; i < S; i++) { w[3][i] = 0; w[7][i] = 0; w[8][i] = inf; ((unsigned*)w[9])[i] = ~0u; ((unsigned*)w[10])[i] = i; ((unsigned*)w[11])[i] = 0; }
              RTCRayNp r; r.org_x = w[0]; r.org_y = w[1]; r.org_z = w[2]; r.tnear = w[3]; r.dir_x = w[4]; r.dir_y = w[5]; r.dir_z = w[6]; r.time = w[7]; r.tfar = w[8];
              r.mask = (unsigned*)w[9]; r.id = (unsigned*)w[10]; r.flags = (unsigned*)w[11];
              rtcOccludedNp(sc, &ctx, &r, cnt);
              for (size_t i = 0; i < cnt; i++) hits[i] += w[8][i] < 0;
            }
          }
          for (size_t i = 0; i < cnt; i++) ao[list[b + i]] = 1.f - float(hits[i]) / N;
          return;
        }
        for (size_t i = b; i < e; i++) {
          uint32_t v = list[i];
          const float* n = &nrm[size_t(v) * 3];
          float o[3]; for (int d = 0; d < 3; d++) o[d] = m.v[size_t(v) * 3 + d] + eps * n[d];
          smp.generate(v, n, bf.p);
          int hit = 0;
          if (var == "gen") { float sum = 0; for (int k = 0; k < N; k++) sum += bf.p[0][k] + bf.p[1][k] + bf.p[2][k]; hit = sum > 1e30f; }
          else if (var == "o1" || var == "o1c") {
            for (int k = 0; k < N; k++) {
              RTCRay r; r.org_x = o[0]; r.org_y = o[1]; r.org_z = o[2]; r.tnear = 0; r.dir_x = bf.p[0][k]; r.dir_y = bf.p[1][k]; r.dir_z = bf.p[2][k];
              r.time = 0; r.tfar = inf; r.mask = -1; r.id = 0; r.flags = 0;
              rtcOccluded1(sc, &ctx, &r);
              hit += r.tfar < 0;
            }
          } else if (var[0] == 'o') {
            auto packet = [&](auto& r, auto occl, auto W) {
              constexpr int w = decltype(W)::value;
              alignas(64) int valid[w];
              for (int k = 0; k < N; k += w) {
                for (int j = 0; j < w; j++) {
                  valid[j] = k + j < N ? -1 : 0;
                  r.org_x[j] = o[0]; r.org_y[j] = o[1]; r.org_z[j] = o[2]; r.tnear[j] = 0; r.time[j] = 0; r.tfar[j] = inf; r.mask[j] = -1; r.id[j] = j; r.flags[j] = 0;
                  r.dir_x[j] = bf.p[0][k + j]; r.dir_y[j] = bf.p[1][k + j]; r.dir_z[j] = bf.p[2][k + j];
                }
                occl(valid, sc, &ctx, &r);
                for (int j = 0; j < w; j++) hit += valid[j] && r.tfar[j] < 0;
              }
            };
            if (var[1] == '4') { RTCRay4 r; packet(r, rtcOccluded4, std::integral_constant<int, 4>()); }
            else { RTCRay8 r; packet(r, rtcOccluded8, std::integral_constant<int, 8>()); }
          } else if (var.substr(0, 3) == "s1M") {
            RTCRay* r = aos[t].data();
            for (int k = 0; k < N; k++) {
              r[k].org_x = o[0]; r[k].org_y = o[1]; r[k].org_z = o[2]; r[k].tnear = 0; r[k].dir_x = bf.p[0][k]; r[k].dir_y = bf.p[1][k]; r[k].dir_z = bf.p[2][k];
              r[k].time = 0; r[k].tfar = inf; r[k].mask = -1; r[k].id = k; r[k].flags = 0;
            }
            rtcOccluded1M(sc, &ctx, r, N, sizeof(RTCRay));
            for (int k = 0; k < N; k++) hit += r[k].tfar < 0;
          } else if (var.substr(0, 3) == "sNp") {
            float* q = (float*)(((uintptr_t)soa[t].data() + 63) & ~uintptr_t(63));
            const int S = (N + 15) / 16 * 16;
            RTCRayNp r; r.org_x = q; r.org_y = q + S; r.org_z = q + 2 * S; r.tnear = q + 3 * S; r.dir_x = q + 4 * S; r.dir_y = q + 5 * S; r.dir_z = q + 6 * S;
            r.time = q + 7 * S; r.tfar = q + 8 * S; r.mask = (unsigned*)(q + 9 * S); r.id = (unsigned*)(q + 10 * S); r.flags = (unsigned*)(q + 11 * S);
            for (int k = 0; k < N; k++) {
              r.org_x[k] = o[0]; r.org_y[k] = o[1]; r.org_z[k] = o[2]; r.tnear[k] = 0; r.time[k] = 0; r.tfar[k] = inf; r.mask[k] = ~0u; r.id[k] = k; r.flags[k] = 0;
              r.dir_x[k] = bf.p[0][k]; r.dir_y[k] = bf.p[1][k]; r.dir_z[k] = bf.p[2][k];
            }
            rtcOccludedNp(sc, &ctx, &r, N);
            for (int k = 0; k < N; k++) hit += r.tfar[k] < 0;
          }
          ao[v] = 1.f - float(hit) / N;
        }
      };
      bench_row(a, "embree3", m, var, T, list.size(), build, mb, ao, list, [&] { return run_threads(T, list.size(), body); });
    }
    if (!a.out.empty()) write_f32(a.out, ao);
    rtcReleaseScene(sc); rtcReleaseDevice(dev);
  }
}
