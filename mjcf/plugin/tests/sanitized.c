// The plugin and the forward integrator under AddressSanitizer and UndefinedBehaviorSanitizer: one model, two
// models on one mjData, copies, refusals. Built and run by the option VWT_SANITIZE of CMakeLists.txt. It fails by
// a sanitizer's report or by EXPECT.

#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <mujoco/mujoco.h>

#include "forward.h"
#define LAW_LANES 4
#include "law.h"

#define EXPECT(condition)                                              \
  do {                                                                 \
    if (!(condition)) {                                                \
      fprintf(stderr, "line %d: not so: %s\n", __LINE__, #condition);  \
      exit(1);                                                         \
    }                                                                  \
  } while (0)

// Under a sanitizer MuJoCo's header calls instrumented functions for its stack, which the released library does not
// have: its plain ones stand in for them.
void plain_mark_stack(mjData* d) __asm__("mj_markStack");
void plain_free_stack(mjData* d) __asm__("mj_freeStack");
void mj__markStack(mjData* d) {
  plain_mark_stack(d);
}
void mj__freeStack(mjData* d) {
  plain_free_stack(d);
}

static jmp_buf back;
static char message[1024];

static void on_error(const char* text) {
  snprintf(message, sizeof(message), "%s", text);
  longjmp(back, 1);
}

// Runs a statement that ends in an error with this text.
#define EXPECT_ERROR(statement, text)              \
  do {                                             \
    if (!setjmp(back)) {                           \
      statement;                                   \
      EXPECT(!"an error was due");                 \
    }                                              \
    EXPECT(strstr(message, text) != NULL);         \
  } while (0)

static const char* const required =
    "<numeric name='air_density' data='1.204'/><numeric name='frontal_area' data='0.036'/>"
    "<numeric name='reference_length' data='0.625'/><numeric name='cn_beta' data='0.35'/>"
    "<numeric name='cn_r' data='-0.7'/>";
static const char* const steady = "<numeric name='wind_speed' data='20'/>";
static const char* const yaw_only = "<config key='joint' value='yaw'/>";
static const char* const twisting = "<config key='joint' value='yaw'/><config key='twist_joint' value='twist'/>";

static mjModel* model(const char* config, const char* before, const char* after, const char* joints, const char* more) {
  static char xml[8192];
  char error[500] = "";
  snprintf(xml, sizeof(xml),
           "<mujoco><option integrator='RK4' timestep='0.001'/><size nuserdata='1' memory='256K'/>"
           "<extension><plugin plugin='vwt.yaw_moment'><instance name='air'>%s</instance>%s</plugin></extension>"
           "<custom>%s%s%s</custom><worldbody><body><joint name='yaw' axis='0 0 1' stiffness='16' damping='0.02'/>%s"
           "<inertial pos='0 0 0' mass='1' diaginertia='0.05 0.05 0.05'/>"
           "<body><joint name='twist' axis='0 0 1' stiffness='500' damping='0.01'/>"
           "<inertial pos='0 0 0' mass='1' diaginertia='0.05 0.05 0.05'/></body></body></worldbody>"
           "<sensor><plugin plugin='vwt.yaw_moment' instance='air'/></sensor></mujoco>",
           config, more, before, required, after, joints);
  mjSpec* spec = mj_parseXMLString(xml, NULL, error, sizeof(error));
  EXPECT(spec != NULL);
  mjModel* m = mj_compile(spec, NULL);
  if (!m) {
    fprintf(stderr, "%s\n", mjs_getError(spec));
  }
  EXPECT(m != NULL);
  mj_deleteSpec(spec);
  return m;
}

static mjtNum run(const mjModel* m, mjData* d) {
  mj_resetData(m, d);
  d->qpos[0] = 0.3;
  mj_forward(m, d);
  for (int i = 0; i < 200; i++) {
    d->userdata[0] = 0.01 * i;
    mj_step(m, d);
  }
  return d->qpos[0] + d->qvel[0] + d->sensordata[0] + d->plugin_state[0];
}

static mjtNum alone(const mjModel* m) {
  mjData* d = mj_makeData(m);
  const mjtNum result = run(m, d);
  mj_deleteData(d);
  return result;
}

static void check_models_on_one_data(void) {
  mjModel* models[] = {
      model(yaw_only, steady, "", "", ""),
      model(yaw_only, "<numeric name='user_a' data='1 2 3'/>", steady, "", ""),
      model(yaw_only, steady, "<numeric name='gravity_stiffness' data='0.5'/><numeric name='aero_lag' data='2'/>"
            "<numeric name='user_of_a_long_name_that_stands_far_from_the_others' data='1'/>", "", ""),
      model(yaw_only, "<numeric name='wind_speed' data='18 19 20 19'/>",
            "<numeric name='wind_speed_interval' data='0.05'/>", "", ""),
      model(twisting, steady, "<numeric name='friction_moment' data='0.02'/><numeric name='presliding' data='0.002'/>",
            "", ""),
      model(twisting, steady, "<numeric name='drive' data='0.1 -0.2 0.3'/><numeric name='drive_interval' data='0.01'/>"
            "<numeric name='drive_held' data='1'/><numeric name='drive_on_end' data='1'/>", "", ""),
      model("<config key='joint' value='twist'/>", steady,
            "<numeric name='friction_load' data='0.2'/><numeric name='gravity_stiffness' data='0.1'/>", "", ""),
  };
  enum { kCount = sizeof(models) / sizeof(models[0]) };
  for (int first = 0; first < kCount; first++) {
    mjData* d = mj_makeData(models[first]);
    for (int i = 0; i < 2 * kCount; i++) {
      const mjModel* m = models[i % kCount];
      EXPECT(run(m, d) == alone(m));
    }
    mjData* copied = mj_copyData(NULL, models[first], d);
    EXPECT(run(models[(first + 1) % kCount], copied) == alone(models[(first + 1) % kCount]));
    mj_copyData(copied, models[first], d);
    mj_deleteData(d);
    EXPECT(run(models[first], copied) == alone(models[first]));
    mj_deleteData(copied);
  }
  for (int i = 0; i < kCount; i++) {
    mj_deleteModel(models[i]);
  }
}

// Two models of the same law, signature and sizes, in turn at one address and without a reset in between.
static void check_models_at_one_address(void) {
  static const char* const play = "<numeric name='free_play' data='0.02'/><numeric name='user_abcd' data='0.3'/>";
  static const char* const other = "<numeric name='user_abcd' data='0.3'/><numeric name='free_play' data='0.02'/>";
  mjModel* models[] = {model(yaw_only, play, steady, "", ""), model(yaw_only, other, steady, "", "")};
  EXPECT(models[0]->signature == models[1]->signature && models[0]->nbuffer == models[1]->nbuffer);
  mjModel* place = mj_copyModel(NULL, models[0]);
  mjData *d = mj_makeData(place), *own = mj_makeData(models[0]);
  d->qpos[0] = own->qpos[0] = 0.3;
  for (int i = 0; i < 8; i++) {
    mj_copyModel(place, models[i % 2]);
    (i < 4 ? mj_forward : mj_step)(place, d);
    (i < 4 ? mj_forward : mj_step)(models[0], own);
    EXPECT(d->qfrc_passive[0] == own->qfrc_passive[0] && d->qvel[0] == own->qvel[0]);
  }
  mj_deleteData(d);
  mj_deleteData(own);
  mj_deleteModel(place);
  mj_deleteModel(models[0]);
  mj_deleteModel(models[1]);
}

static void check_data_of_other_sizes(void) {
  const char* const other = "mjData was made for a model of other sizes";
  mjModel* small = model(yaw_only, steady, "", "", "");
  mjModel* large = model(yaw_only, steady, "", "<joint name='more' type='slide'/>", "");
  mjModel* two = model(yaw_only, steady, "", "", "<instance name='b'><config key='joint' value='twist'/></instance>");
  mjData* d = mj_makeData(large);
  EXPECT_ERROR(mj_forward(small, d), other);
  mj_deleteData(d);
  d = mj_makeData(large);
  EXPECT_ERROR(mj_step(small, d), other);
  mj_deleteData(d);
  d = mj_makeData(two);
  EXPECT_ERROR(mj_resetData(small, d), other);
  mj_deleteData(d);
  mj_deleteModel(small);
  mj_deleteModel(large);
  mj_deleteModel(two);
}

static void check_forward(void) {
  enum { kSamples = 200 };
  const double wind[] = {18, 20, 19};
  double angle[kSamples], rate[kSamples], *angles[] = {angle}, *rates[] = {rate};
  const double program[] = {VWT_OPERATION_number, -2, VWT_OPERATION_angle, VWT_OPERATION_cube, VWT_OPERATION_multiply};
  for (int kind = 0; kind < 5; kind++) {
    vwt_parameters p = {.air_density = 1.2, .frontal_area = 0.036, .reference_length = 0.625, .cn_beta = 0.35,
                        .cn_r = -0.7, .spring_stiffness = 16, .yaw_inertia = 0.1, .mechanical_damping = 0.02,
                        .aero_lag = 2, .friction_moment = kind ? 0.02 : 0, .presliding = kind == 2 ? 0.002 : 0};
    const vwt_run one = {.wind = wind, .wind_count = 3, .wind_interval = 0.05, .angle = 0.3, .lagged = 0.3,
                         .twist_stiffness = kind == 3 ? 500 : 0, .inertia_share = 0.3, .step = 0.001, .steps = 2,
                         .samples = kSamples, .program = program, .program_count = kind == 4 ? 5 : 0};
    EXPECT(vwt_forward(1, &p, &one, angles, rates) == 0);
    EXPECT(angle[kSamples - 1] > -1 && angle[kSamples - 1] < 1);
  }
  const double broken[] = {VWT_OPERATION_add, VWT_OPERATION_number, 1e300, -1, VWT_OPERATION_angle, VWT_OPERATION_number};
  const vwt_program_input in = {0.1, 0.2, 0.3, 0.4};
  for (int i = 0; i < 6; i++) {
    double value;
    vwt_evaluate(6 - i, broken + i, 1, &in, &value);
    EXPECT(value != value);
  }
  EXPECT(vwt_no_clock() == 0);
  vwt_backlash(kSamples, angle, 0.01, 0.3, angle);
  for (int i = 0; i < vwt_run_count(); i++) {
    EXPECT(vwt_run_offset(i) + (int)sizeof(double) <= vwt_run_size() && vwt_run_name(i)[0]);
  }
  for (int i = 0; i < vwt_state_count(); i++) {
    EXPECT(vwt_state_name(i)[0]);
  }
}

// Programs side by side: one of every operation, and one that fills the stack; the last run has none.
static void check_programs(void) {
  enum { kRuns = 6, kSamples = 100, kDeep = 3 * VWT_STACK - 1 };
  double deep[kDeep], every[8 * VWT_OPERATION_COUNT];
  const double above_none[] = {VWT_OPERATION_cos, VWT_OPERATION_square, VWT_OPERATION_number, 0.5, VWT_OPERATION_add};
  int size = 0;
  for (int i = 0; i < kDeep; i++) {
    deep[i] = i >= 2 * VWT_STACK ? VWT_OPERATION_add : i % 2 ? 1e-4 : VWT_OPERATION_number;
  }
  for (int operation = VWT_OPERATION_angle; operation < VWT_OPERATION_COUNT; operation++) {
    const int taken = vwt_operation_taken[operation];
    if (taken == 2) {
      every[size++] = VWT_OPERATION_number;
      every[size++] = 1.5;
    }
    every[size++] = operation;
    if (taken == 0 && operation != VWT_OPERATION_angle) {
      every[size++] = VWT_OPERATION_add;
    }
    for (int i = 0; i < 5; i++) {  // roots and logarithms have values
      every[size++] = above_none[i];
    }
  }
  static double angle[kRuns][kSamples], rate[kRuns][kSamples], alone[kSamples], alone_rate[kSamples];
  double *angles[kRuns], *rates[kRuns], *one[] = {alone}, *one_rate[] = {alone_rate};
  const double wind[] = {18}, nothing[] = {0};
  vwt_parameters p[kRuns];
  vwt_run runs[kRuns];
  for (int i = 0; i < kRuns; i++) {
    p[i] = (vwt_parameters){.spring_stiffness = 16, .yaw_inertia = 0.1, .mechanical_damping = 0.02};
    runs[i] = (vwt_run){.wind = wind, .wind_count = 1, .angle = 0.3 + 0.01 * i, .step = 0.002, .steps = 2,
                        .samples = kSamples, .program = i < 3 ? deep : every,
                        .program_count = i == 5 ? 0 : i < 3 ? kDeep : size};
    angles[i] = angle[i];
    rates[i] = rate[i];
  }
  EXPECT(vwt_forward(kRuns, p, runs, angles, rates) == 0);
  for (int i = 0; i < kRuns; i++) {
    runs[i].forcing = nothing;  // keeps it from the others
    runs[i].forcing_count = 1;
    EXPECT(vwt_forward(1, &p[i], &runs[i], one, one_rate) == 0);
    EXPECT(fabs(angle[i][kSamples - 1] - alone[kSamples - 1]) < 1e-12);
  }
}

static void check_slopes(void) {
  enum { kSamples = 200, kRuns = 5, kTerms = VWT_TERM_COUNT, kColumns = kTerms + VWT_MOST_CHANGES, kWinds = 3,
         kDrives = 4 };
  static double angle[kRuns][kSamples], rate[kRuns][kSamples];
  static double by_angle[kRuns][kColumns * kSamples], by_rate[kRuns][kColumns * kSamples];
  double *angles[kRuns], *rates[kRuns], *by_angles[kRuns], *by_rates[kRuns], values[kRuns * VWT_TERM_COUNT];
  const double wind[kWinds] = {18, 16, 19}, sums[] = {0.5, 0.5, 0.01, -0.01}, *weights[kRuns], *winds[kRuns];
  const double drive[kDrives] = {1, -1, 2, 0}, drive_time[kDrives] = {0, 0.1, 0.2, 0.3}, drive_slope[kDrives] = {-20, 30};
  static const double changes[VWT_MOST_CHANGES * 2 * kDrives];
  vwt_parameters p[kRuns];
  vwt_run runs[kRuns];
  int columns[kColumns];
  for (int i = 0; i < kColumns; i++) {
    columns[i] = i;
    EXPECT(i >= kTerms || vwt_term_name(i)[0]);
  }
  EXPECT(vwt_term_count() == kTerms && vwt_most_changes() == VWT_MOST_CHANGES);
  for (int features = 0; features < 8; features++) {
    for (int i = 0; i < kRuns; i++) {
      const int sampled = i % 2 && !(features & 5);  // a lag and vortices want a constant wind
      p[i] = (vwt_parameters){.air_density = 1.2, .frontal_area = 0.036, .reference_length = 0.625, .width = 0.2,
                              .cn_beta = 0.35, .cn_r = -0.7, .spring_stiffness = 16, .yaw_inertia = 0.1,
                              .mechanical_damping = 0.02, .aero_lag = features & 1 ? 2 : 0,
                              .friction_moment = features & 2 ? 0.02 : 0, .friction_saturation = features & 4 ? 0.1 : 0,
                              .shedding_amplitude = features & 4 ? 0.01 : 0, .strouhal_number = 0.1,
                              .stiffness_cubic_exponent = features & 4 ? 2.5 : 0};
      runs[i] = (vwt_run){.wind = wind, .wind_count = sampled ? kWinds : 1, .wind_interval = 0.1,
                          .angle = 0.3 + 0.01 * i, .lagged = 0.3, .step = 0.002,
                          .steps = features & 1 ? 2 : 1, .stride = 3, .samples = kSamples - i};
      if (i == 4) {
        runs[i].moment = drive;
        runs[i].moment_time = drive_time;
        runs[i].moment_slope = drive_slope;
        runs[i].moment_count = kDrives;
        runs[i].moment_interval = 0.1;
        runs[i].moment_scale = 0.5;
      }
      angles[i] = angle[i];
      rates[i] = rate[i];
      by_angles[i] = by_angle[i];
      by_rates[i] = by_rate[i];
      weights[i] = sums;
      winds[i] = changes;
    }
    EXPECT(vwt_slopes(kRuns, p, runs, kSamples, kColumns, columns, winds, NULL, 1, angles, rates, by_angles, by_rates) == 0);
    EXPECT(vwt_slopes(kRuns, p, runs, kSamples, kColumns, columns, winds, weights, 1, angles, rates, by_angles, NULL) == 0);
    vwt_terms(kRuns, p, runs, values);
    EXPECT(values[VWT_TERM_start_angle] == 0.3);
  }
}

static double greater(double one, double other) { return one > other ? one : other; }

// The elementary functions of runs side by side against the library's.
static void check_functions(void) {
  double of_sine = 0, of_cosine = 0, of_power = 0, of_tangent = 0, of_exponential = 0;
  for (int i = 0; i <= 2000000; i++) {
    const double angle = i < 1000000 ? 1e-5 * (i - 500000) : (i - 1500000) * 1.37;
    const Lane x = (Lane){0} + angle;
    of_sine = greater(of_sine, fabs(sine(x)[i % LAW_LANES] - sin(angle)));
    of_cosine = greater(of_cosine, fabs(cosine(x)[i % LAW_LANES] - cos(angle)));
  }
  for (int i = -200000; i <= 200000; i++) {
    const double x = exp(1e-4 * i), n = 0.1 + 2.9 * fabs(sin((double)i)), y = 3.3e-3 * i;
    const Lane lane = (Lane){0} + x;
    of_power = greater(of_power, fabs(power(lane, (Lane){0} + n)[0] / pow(x, n) - 1));
    of_tangent = greater(of_tangent, fabs(hyperbolic_tangent(lane)[0] - tanh(x)));
    of_exponential = greater(of_exponential, fabs(exponential((Lane){0} + y)[0] / exp(y) - 1));
  }
  EXPECT(of_sine > 0 && of_sine < 3e-16);
  EXPECT(of_cosine < 3e-16);
  EXPECT(of_power < 3e-14);  // the rounding error of its logarithm
  EXPECT(of_tangent < 4e-16);
  EXPECT(of_exponential < 1e-15);
  EXPECT(power((Lane){0}, (Lane){0} + 2)[0] == 0);
  EXPECT(hyperbolic_tangent((Lane){0} - 3)[0] == -hyperbolic_tangent((Lane){0} + 3)[0]);
  EXPECT(exponential((Lane){0} - 1e6)[0] > 0 && exponential((Lane){0} - 1e6)[0] < 1e-300);
}

int main(void) {
  check_functions();
  check_forward();
  check_programs();
  check_slopes();
  mju_user_error = on_error;
  check_models_on_one_data();
  check_models_at_one_address();
  check_data_of_other_sizes();
  puts("the plugin is clean with one model and with two");
  return 0;
}
